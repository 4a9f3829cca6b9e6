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
  Vector6d bias = Vector6d::Zero();  ///< that the errors of the Jacobians give b on the average
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();  ///< of the features, body frame
  double second_moment = 0.0;
  double fit = 0.0;
  double squared_error = 0.0;
  std::size_t count = 0;

  Sum& operator+=(const Sum& other) {
    H += other.H;
    noise += other.noise;
    b += other.b;
    bias += other.bias;
    first_moment += other.first_moment;
    second_moment += other.second_moment;
    fit += other.fit;
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

/// Residuals of a scan at one pose.
class Residuals {
 public:
  Residuals(const Config& config, const Eigen::Vector3d& origin, const Eigen::Quaterniond& q_odom_imu,
            const Eigen::Vector3d& t_odom_imu, const MatchSettings& settings);

  /// Distance of a point to a plane or a line along the cell's axis `normal`; the cell knows that axis no
  /// better than its points allow along its axes from `first_slope` on.
  void add_distance(const Eigen::Vector3d& p_imu, const Cell& cell, int normal, int first_slope,
                    double weight, Sum* sum) const;
  /// Difference between the cell's intensity at the point and the point's own.
  void add_intensity(const Eigen::Vector3d& p_imu, double level, const Cell& cell, Sum* sum) const;

  Eigen::Vector3d in_map(const Eigen::Vector3d& p_imu) const { return R_ * p_imu + t_; }

  /// Sums the residuals that `add(i, sum)` adds for each feature, in an order that no number of threads
  /// changes.
  template <typename Add>
  static Sum sum_up(std::size_t count, const Add& add);

  LidarInformation finish(const Eigen::Quaterniond& q_odom_imu, const Sum& sum) const;

 private:
  struct Residual {
    Eigen::Vector3d gradient;  ///< dr/dp in the map frame
    double value;
    double variance;
    double
        slope_variance;  ///< the gradient's variance along an axis, times that of the cell's points along it
    int first_slope;
  };

  Vector6d jacobian(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& gradient) const;
  double point_variance(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& n) const;
  void add(const Eigen::Vector3d& p_imu, const Cell& cell, const Residual& residual, double weight,
           Sum* sum) const;

  const MappingConfig& mapping_;
  const MatchSettings& settings_;
  Eigen::Vector3d origin_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d t_;
  double range_variance_;
  double angle_variance_;
};

Residuals::Residuals(const Config& config, const Eigen::Vector3d& origin,
                     const Eigen::Quaterniond& q_odom_imu, const Eigen::Vector3d& t_odom_imu,
                     const MatchSettings& settings)
    : mapping_(config.mapping),
      settings_(settings),
      origin_(origin),
      R_(q_odom_imu.toRotationMatrix()),
      t_(t_odom_imu),
      range_variance_(config.sensor.range_noise_m * config.sensor.range_noise_m +
                      config.mapping.surface_roughness_m * config.mapping.surface_roughness_m),
      angle_variance_(std::pow(config.sensor.beam_angle_noise_deg * M_PI / 180.0, 2)) {}

/// Of a residual with the gradient dr/dp in the map frame: [p_imu x R' dr/dp, dr/dp], by a right perturbation
/// of R and a shift of t.
Vector6d Residuals::jacobian(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& gradient) const {
  Vector6d J;
  J << p_imu.cross(R_.transpose() * gradient), gradient;
  return J;
}

/// Variance of the point's position along the unit vector n (map frame).
double Residuals::point_variance(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& n) const {
  const Eigen::Vector3d beam = p_imu - origin_;
  const double tangential_sq = beam.squaredNorm() - std::pow(beam.dot(R_.transpose() * n), 2);
  return range_variance_ + angle_variance_ * tangential_sq;
}

void Residuals::add(const Eigen::Vector3d& p_imu, const Cell& cell, const Residual& residual, double weight,
                    Sum* sum) const {
  const double r = residual.value;
  if (r * r > settings_.max_deviation * settings_.max_deviation * residual.variance) return;
  const double fit = robust_weight(r, residual.variance, mapping_.robust_scale);
  const double information = weight * fit / residual.variance;
  const Vector6d J = jacobian(p_imu, residual.gradient);
  sum->H.noalias() += information * J * J.transpose();
  sum->b.noalias() += information * r * J;
  const Eigen::Vector3d offset = in_map(p_imu) - cell.mean;
  for (int axis = residual.first_slope; axis < 3; ++axis) {
    if (cell.variances[axis] <= cell.variances[0]) continue;
    const double slope = residual.slope_variance / cell.variances[axis];
    const Vector6d error = jacobian(p_imu, cell.axes.col(axis));
    sum->noise.noalias() += information * slope * error * error.transpose();
    sum->bias.noalias() += information * slope * cell.axes.col(axis).dot(offset) * error;
  }
  sum->first_moment += p_imu;
  sum->second_moment += p_imu.squaredNorm();
  sum->fit += fit;
  sum->squared_error += r * r;
  ++sum->count;
}

void Residuals::add_distance(const Eigen::Vector3d& p_imu, const Cell& cell, int normal, int first_slope,
                             double weight, Sum* sum) const {
  const Eigen::Vector3d offset = in_map(p_imu) - cell.mean;
  Residual residual;
  residual.gradient = cell.axes.col(normal);
  residual.value = residual.gradient.dot(offset);
  if (std::abs(residual.value) > settings_.max_residual_m) return;
  residual.variance = point_variance(p_imu, residual.gradient) +
                      cell.variances[normal] * (1.0 + leverage(cell, offset, normal) / cell.count);
  residual.slope_variance = std::max(cell.variances[normal], range_variance_) / cell.count;
  residual.first_slope = first_slope;
  add(p_imu, cell, residual, weight, sum);
}

void Residuals::add_intensity(const Eigen::Vector3d& p_imu, double level, const Cell& cell, Sum* sum) const {
  const Eigen::Vector3d offset = in_map(p_imu) - cell.mean;
  Residual residual;
  residual.gradient = cell.intensity_gradient;
  residual.value = cell.mean_intensity + residual.gradient.dot(offset) - level;
  residual.variance = cell.intensity_variance * (1.0 + leverage(cell, offset, 0) / cell.count) +
                      point_variance(p_imu, residual.gradient.normalized()) * residual.gradient.squaredNorm();
  residual.slope_variance = cell.intensity_variance / cell.count;
  residual.first_slope = 1;
  add(p_imu, cell, residual, settings_.intensity_weight, sum);
}

template <typename Add>
Sum Residuals::sum_up(std::size_t count, const Add& add) {
  std::vector<Sum> sums((count + kChunk - 1) / kChunk);
  parallel_chunks(count, kChunk, [&](std::size_t begin, std::size_t end, std::size_t chunk) {
    for (std::size_t i = begin; i < end; ++i) add(i, &sums[chunk]);
  });
  Sum total;
  for (const Sum& sum : sums) total += sum;
  return total;
}

LidarInformation Residuals::finish(const Eigen::Quaterniond& q_odom_imu, const Sum& sum) const {
  LidarInformation information;
  information.q_odom_imu = q_odom_imu;
  information.t_odom_imu = t_;
  // Neighbouring residuals share the errors of the map and of the beam calibration.
  information.H = sum.H / mapping_.correlation_factor;
  information.b = sum.b / mapping_.correlation_factor;
  information.bias = sum.bias / mapping_.correlation_factor;
  information.noise_information = sum.noise / mapping_.correlation_factor;
  information.fit = sum.fit;
  information.squared_error = sum.squared_error;
  information.independent = static_cast<double>(sum.count) / mapping_.correlation_factor;
  if (sum.count == 0) return information;
  const double count = static_cast<double>(sum.count);
  information.centroid_imu = sum.first_moment / count;
  information.radius_m =
      std::sqrt(std::max(0.0, sum.second_moment / count - information.centroid_imu.squaredNorm()));
  return information;
}

}  // namespace

LidarInformation ScanMatcher::linearise(const MatchInput& input, const VoxelMap& plane_map,
                                        const VoxelMap& edge_map, const Eigen::Quaterniond& q_odom_imu,
                                        const Eigen::Vector3d& t_odom_imu,
                                        const MatchSettings& settings) const {
  const Residuals residuals(config_, input.origin, q_odom_imu, t_odom_imu, settings);
  Sum sum = Residuals::sum_up(input.planes.size(), [&](std::size_t i, Sum* part) {
    const Eigen::Vector3d& p = input.planes[i];
    const Cell* cell = plane_map.find_plane(residuals.in_map(p), settings.wide);
    if (cell != nullptr) residuals.add_distance(p, *cell, 0, 1, settings.plane_weight, part);
  });
  const std::size_t planes = sum.count;
  sum += Residuals::sum_up(input.edges.size(), [&](std::size_t i, Sum* part) {
    const Eigen::Vector3d& p = input.edges[i];
    const Cell* cell = edge_map.find_line(residuals.in_map(p));
    if (cell == nullptr) return;
    residuals.add_distance(p, *cell, 0, 2, settings.edge_weight, part);
    residuals.add_distance(p, *cell, 1, 2, settings.edge_weight, part);
  });
  LidarInformation information = residuals.finish(q_odom_imu, sum);
  information.planes = planes;
  information.edges = (sum.count - planes) / 2;
  return information;
}

LidarInformation ScanMatcher::linearise_textures(const MatchInput& input, const VoxelMap& texture_map,
                                                 const Eigen::Quaterniond& q_odom_imu,
                                                 const Eigen::Vector3d& t_odom_imu,
                                                 const MatchSettings& settings) const {
  const Residuals residuals(config_, input.origin, q_odom_imu, t_odom_imu, settings);
  const Sum sum = Residuals::sum_up(input.textures.size(), [&](std::size_t i, Sum* part) {
    const Eigen::Vector3d& p = input.textures[i];
    const Cell* cell = texture_map.find_texture(residuals.in_map(p));
    if (cell != nullptr) residuals.add_intensity(p, input.levels[i], *cell, part);
  });
  LidarInformation information = residuals.finish(q_odom_imu, sum);
  information.textures = sum.count;
  return information;
}

}  // namespace fdi_lio::mapping
