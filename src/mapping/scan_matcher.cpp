#include "fdi_lio/mapping/scan_matcher.hpp"

#include <cmath>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr std::size_t kChunk = 256;

/// Normal equations of some residuals.
struct Sum {
  Matrix6d H = Matrix6d::Zero();
  Matrix6d noise = Matrix6d::Zero();  ///< that the errors of the Jacobians add to H
  Vector6d b = Vector6d::Zero();
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();  ///< of the features, body frame
  double second_moment = 0.0;
  double squared_error = 0.0;
  std::size_t count = 0;

  Sum& operator+=(const Sum& other) {
    H += other.H;
    noise += other.noise;
    b += other.b;
    first_moment += other.first_moment;
    second_moment += other.second_moment;
    squared_error += other.squared_error;
    count += other.count;
    return *this;
  }
};

/// Factor by which the error of a regression in the cell (its mean and two tilts, from `count` points)
/// grows at `offset` from its mean, over that of the mean alone; `normal` is the axis it is about.
double leverage(const Cell& cell, const Eigen::Vector3d& offset, int normal) {
  double factor = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == normal || cell.variances[axis] <= cell.variances[normal]) continue;
    const double along = cell.axes.col(axis).dot(offset);
    factor += along * along / cell.variances[axis];
  }
  return factor;
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

LidarInformation ScanMatcher::linearise(const MatchInput& input, const FeatureMaps& maps,
                                        const Eigen::Quaterniond& q_odom_imu,
                                        const Eigen::Vector3d& t_odom_imu,
                                        const MatchSettings& settings) const {
  const Eigen::Matrix3d R = q_odom_imu.toRotationMatrix();
  // Any residual r(R p_imu + t) with gradient n = dr/dp in the map frame has the derivative
  // [p_imu x R' n, n] by a right perturbation of R and a shift of t.
  const auto jacobian_of = [&](const Eigen::Vector3d& p_imu, const Eigen::Vector3d& n) {
    Vector6d jacobian;
    jacobian << p_imu.cross(R.transpose() * n), n;
    return jacobian;
  };
  // The gradient n itself has the variance slope_variance / (variance of the cell's points along a) along
  // each axis a of the cell from first_slope on.
  const auto add_residual = [&](const Eigen::Vector3d& p_imu, const Eigen::Vector3d& n, double residual,
                                double variance, double weight, const Cell& cell, int first_slope,
                                double slope_variance, Sum* sum) {
    if (residual * residual > settings.max_deviation * settings.max_deviation * variance) return;
    const double information = weight * robust_weight(residual, variance, mapping_.robust_scale) / variance;
    const Vector6d jacobian = jacobian_of(p_imu, n);
    sum->H.noalias() += information * jacobian * jacobian.transpose();
    sum->b.noalias() += information * residual * jacobian;
    for (int axis = first_slope; axis < 3; ++axis) {
      if (cell.variances[axis] <= cell.variances[0]) continue;
      const Vector6d error = jacobian_of(p_imu, cell.axes.col(axis));
      sum->noise.noalias() += information * slope_variance / cell.variances[axis] * error * error.transpose();
    }
    sum->first_moment += p_imu;
    sum->second_moment += p_imu.squaredNorm();
    sum->squared_error += residual * residual;
    ++sum->count;
  };
  // Variance of the point's position along the unit vector n (map frame).
  const auto point_variance = [&](const Eigen::Vector3d& p_imu, const Eigen::Vector3d& n) {
    const Eigen::Vector3d beam = p_imu - input.origin;
    const double tangential_sq = beam.squaredNorm() - std::pow(beam.dot(R.transpose() * n), 2);
    return range_variance_ + angle_variance_ * tangential_sq;
  };
  const auto add = [&](const Eigen::Vector3d& p_imu, const Cell& cell, int axis, int first_slope,
                       double weight, Sum* sum) {
    const Eigen::Vector3d offset = R * p_imu + t_odom_imu - cell.mean;
    const Eigen::Vector3d normal = cell.axes.col(axis);
    const double residual = normal.dot(offset);
    if (std::abs(residual) > settings.max_residual_m) return;
    const double surface = cell.variances[axis] * (1.0 + leverage(cell, offset, axis) / cell.count);
    const double slope_variance = std::max(cell.variances[axis], range_variance_) / cell.count;
    add_residual(p_imu, normal, residual, point_variance(p_imu, normal) + surface, weight, cell, first_slope,
                 slope_variance, sum);
  };
  const auto add_texture = [&](const Eigen::Vector3d& p_imu, double level, const Cell& cell, Sum* sum) {
    const Eigen::Vector3d offset = R * p_imu + t_odom_imu - cell.mean;
    const Eigen::Vector3d& gradient = cell.intensity_gradient;
    const double residual = cell.mean_intensity + gradient.dot(offset) - level;
    const double texture = cell.intensity_variance * (1.0 + leverage(cell, offset, 0) / cell.count);
    const double shift = point_variance(p_imu, gradient.normalized()) * gradient.squaredNorm();
    add_residual(p_imu, gradient, residual, texture + shift, settings.intensity_weight, cell, 1,
                 cell.intensity_variance / cell.count, sum);
  };
  const auto reduce = [&](std::size_t count, auto&& match) {
    std::vector<Sum> sums((count + kChunk - 1) / kChunk);
    parallel_chunks(count, kChunk, [&](std::size_t begin, std::size_t end, std::size_t chunk) {
      for (std::size_t i = begin; i < end; ++i) match(i, &sums[chunk]);
    });
    Sum total;
    for (const Sum& sum : sums) total += sum;
    return total;
  };
  const Sum planes = reduce(input.planes.size(), [&](std::size_t i, Sum* sum) {
    const Eigen::Vector3d& p = input.planes[i];
    const Cell* cell = maps.planes.find_plane(R * p + t_odom_imu, settings.wide);
    if (cell != nullptr) add(p, *cell, 0, 1, settings.plane_weight, sum);
  });
  const Sum edges = reduce(input.edges.size(), [&](std::size_t i, Sum* sum) {
    const Eigen::Vector3d& p = input.edges[i];
    const Cell* cell = maps.edges.find_line(R * p + t_odom_imu);
    if (cell == nullptr) return;
    add(p, *cell, 0, 2, settings.edge_weight, sum);
    add(p, *cell, 1, 2, settings.edge_weight, sum);
  });
  const std::size_t texture_count = maps.textures != nullptr ? input.textures.size() : 0;
  const Sum textures = reduce(texture_count, [&](std::size_t i, Sum* sum) {
    const Eigen::Vector3d& p = input.textures[i];
    const Cell* cell = maps.textures->find_texture(R * p + t_odom_imu);
    if (cell != nullptr) add_texture(p, input.levels[i], *cell, sum);
  });

  LidarInformation information;
  information.q_odom_imu = q_odom_imu;
  information.t_odom_imu = t_odom_imu;
  // Neighbouring residuals share the errors of the map and of the beam calibration.
  information.H = (planes.H + edges.H + textures.H) / mapping_.correlation_factor;
  information.b = (planes.b + edges.b + textures.b) / mapping_.correlation_factor;
  information.noise_information = (planes.noise + edges.noise + textures.noise) / mapping_.correlation_factor;
  Sum all = planes;
  all += edges;
  all += textures;
  information.independent = static_cast<double>(all.count) / mapping_.correlation_factor;
  if (all.count > 0) {
    const double count = static_cast<double>(all.count);
    information.centroid_imu = all.first_moment / count;
    information.radius_m =
        std::sqrt(std::max(0.0, all.second_moment / count - information.centroid_imu.squaredNorm()));
  }
  information.squared_error = planes.squared_error + edges.squared_error;
  information.planes = planes.count;
  information.edges = edges.count / 2;
  information.textures = textures.count;
  return information;
}

}  // namespace fdi_lio::mapping
