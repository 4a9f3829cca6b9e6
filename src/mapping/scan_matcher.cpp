#include "fdi_lio/mapping/scan_matcher.hpp"

#include <cmath>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr std::size_t kChunk = 256;

/// Normal equations of some residuals.
struct Sum {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  double squared_error = 0.0;
  std::size_t count = 0;

  Sum& operator+=(const Sum& other) {
    H += other.H;
    b += other.b;
    squared_error += other.squared_error;
    count += other.count;
    return *this;
  }
};

/// Variance of the cell's mean surface at `offset` from its mean, along axis `normal`: regression error of
/// the mean and of the two tilts, each from `count` points with the cell's own deviation.
double surface_variance(const Cell& cell, const Eigen::Vector3d& offset, int normal) {
  double leverage = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == normal || cell.variances[axis] <= cell.variances[normal]) continue;
    const double along = cell.axes.col(axis).dot(offset);
    leverage += along * along / cell.variances[axis];
  }
  return cell.variances[normal] / cell.count * leverage;
}

/// Cauchy weight of a residual of the given variance; its scale is in standard deviations.
double robust_weight(double residual, double variance, double scale) {
  return 1.0 / (1.0 + residual * residual / (variance * scale * scale));
}

}  // namespace

ScanMatcher::ScanMatcher(const Config& config)
    : mapping_(config.mapping),
      range_variance_(config.sensor.range_noise_m * config.sensor.range_noise_m +
                      config.mapping.surface_roughness_m * config.mapping.surface_roughness_m),
      angle_variance_(std::pow(config.sensor.beam_angle_noise_deg * M_PI / 180.0, 2)) {}

LidarInformation ScanMatcher::linearise(const MatchInput& input, const VoxelMap& plane_map,
                                        const VoxelMap& edge_map, const Eigen::Quaterniond& q_odom_imu,
                                        const Eigen::Vector3d& t_odom_imu,
                                        const MatchSettings& settings) const {
  const Eigen::Matrix3d R = q_odom_imu.toRotationMatrix();
  // Distance of p to the surface through cell.mean with normal column `axis`: r = n' (R p_imu + t - mean),
  // and its derivative by a right perturbation of R and a shift of t: [p_imu x R' n, n].
  const auto add = [&](const Eigen::Vector3d& p_imu, const Cell& cell, int axis, double weight, Sum* sum) {
    const Eigen::Vector3d offset = R * p_imu + t_odom_imu - cell.mean;
    const Eigen::Vector3d normal = cell.axes.col(axis);
    const double residual = normal.dot(offset);
    if (std::abs(residual) > settings.max_residual_m) return;
    const Eigen::Vector3d normal_imu = R.transpose() * normal;
    const Eigen::Vector3d beam = p_imu - input.origin;
    const double tangential_sq = beam.squaredNorm() - std::pow(beam.dot(normal_imu), 2);
    const double variance = range_variance_ + angle_variance_ * tangential_sq + cell.variances[axis] +
                            surface_variance(cell, offset, axis);
    if (residual * residual > settings.max_deviation * settings.max_deviation * variance) return;
    const double information = weight * robust_weight(residual, variance, mapping_.robust_scale) / variance;
    Vector6d jacobian;
    jacobian << p_imu.cross(normal_imu), normal;
    sum->H.noalias() += information * jacobian * jacobian.transpose();
    sum->b.noalias() += information * residual * jacobian;
    sum->squared_error += residual * residual;
    ++sum->count;
  };
  const auto reduce = [&](const std::vector<Eigen::Vector3d>& points, auto&& match) {
    std::vector<Sum> sums((points.size() + kChunk - 1) / kChunk);
    parallel_chunks(points.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t chunk) {
      for (std::size_t i = begin; i < end; ++i) match(points[i], &sums[chunk]);
    });
    Sum total;
    for (const Sum& sum : sums) total += sum;
    return total;
  };
  const Sum planes = reduce(input.planes, [&](const Eigen::Vector3d& p, Sum* sum) {
    const Cell* cell = plane_map.find_plane(R * p + t_odom_imu, settings.wide);
    if (cell != nullptr) add(p, *cell, 0, settings.plane_weight, sum);
  });
  const Sum edges = reduce(input.edges, [&](const Eigen::Vector3d& p, Sum* sum) {
    const Cell* cell = edge_map.find_line(R * p + t_odom_imu);
    if (cell == nullptr) return;
    add(p, *cell, 0, settings.edge_weight, sum);
    add(p, *cell, 1, settings.edge_weight, sum);
  });

  LidarInformation information;
  information.q_odom_imu = q_odom_imu;
  information.t_odom_imu = t_odom_imu;
  // Neighbouring residuals share the errors of the map and of the beam calibration.
  information.H = (planes.H + edges.H) / mapping_.correlation_factor;
  information.b = (planes.b + edges.b) / mapping_.correlation_factor;
  information.squared_error = planes.squared_error + edges.squared_error;
  information.planes = planes.count;
  information.edges = edges.count / 2;
  return information;
}

}  // namespace fdi_lio::mapping
