#include "fdi_lio/matching/scan_matcher.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/matching/beam_motions.hpp"
#include "fdi_lio/matching/plane_weights.hpp"
#include "fdi_lio/matching/product_sum.hpp"

namespace fdi_lio::matching {

namespace {

constexpr std::size_t kChunk = 256;
constexpr double kRadians = M_PI / 180.0;
/// Intensities are matched within the square root of it from the mean of a cell's points, in their
/// deviations, which is how far evenly spread points reach: paint ends, and a slope that is fitted to its
/// edge overshoots beyond.
constexpr double kSquaredTextureReach = 3.0;
/// Lines tell of their radius when they are seen from about the side that they are known from: of what they
/// look like from behind the thick ones decide, which hardly count for the pose.
constexpr double kMostTurned = 0.5;
/// Of the errors of a beam that the next one does not have: what is smooth from beam to beam tilts no plane.
constexpr double kUnsmooth = 0.5;

/// Normal equations of some residuals.
struct Sum {
  ProductSum products;
  ProductSum noise;   ///< what the errors of the Jacobians add to them on the average
  RadiusSums radius;  ///< of lines
  Eigen::Vector3d first_moment = Eigen::Vector3d::Zero();  ///< of the features, body frame
  double second_moment = 0.0;
  double squared_error = 0.0;
  std::size_t count = 0;

  Sum& operator+=(const Sum& other) {
    products.add(other.products);
    noise.add(other.noise);
    radius.information += other.radius.information;
    radius.gradient += other.radius.gradient;
    radius.with_pose += other.radius.with_pose;
    first_moment += other.first_moment;
    second_moment += other.second_moment;
    squared_error += other.squared_error;
    count += other.count;
    return *this;
  }
};

/// Square of how far `offset` is from the mean of the cell's points across the axis `normal`, in their
/// deviations.
double squared_reach(const Cell& cell, const Eigen::Vector3d& offset, int normal) {
  double sum = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == normal || cell.variances[axis] <= cell.variances[normal]) continue;
    const double along = cell.axes.col(axis).dot(offset);
    sum += along * along / cell.variances[axis];
  }
  return sum;
}

/// Factor by which the error of a regression in the cell (its mean and two tilts, from `count` points)
/// grows at `offset` from its mean, over that of the mean alone; `normal` is the axis it is about.
double leverage(const Cell& cell, const Eigen::Vector3d& offset, int normal) {
  return 1.0 + squared_reach(cell, offset, normal);
}

/// Cauchy weight of a residual of the given variance; its scale is in standard deviations.
double robust_weight(double residual, double variance, double scale) {
  return 1.0 / (1.0 + residual * residual / (variance * scale * scale));
}

/// Residuals of a scan at one pose.
class Residuals {
 public:
  Residuals(const Config& config, const MatchInput& input, const Eigen::Quaterniond& q_odom_imu,
            const Eigen::Vector3d& t_odom_imu, const MatchSettings& settings);

  struct Residual {
    Eigen::Vector3d gradient;  ///< dr/dp in the map frame
    double value = 0.0;
    double variance = 0.0;
    double slope_variance = 0.0;  ///< variance of `gradient` along an axis, times that of the cell's points
    double by_radius = 0.0;       ///< d value / d mean radius of lines
    int first_slope = 0;
  };

  /// Distance of a point to the cell's plane.
  Residual plane(const Eigen::Vector3d& p_imu, const Cell& cell) const;
  /// Distance of a point to the cell's line along the axis `normal`, 0 or 1.
  Residual line(const Eigen::Vector3d& p_imu, const Cell& cell, int normal) const;
  /// Difference between the cell's intensity at the point and the point's own.
  Residual intensity(const Eigen::Vector3d& p_imu, double level, const Cell& cell) const;
  void add(const Eigen::Vector3d& p_imu, const Cell& cell, const Residual& residual, double weight,
           Sum* sum) const;
  /// The point's match with a plane of the map.
  PlaneMatch plane_match(const Eigen::Vector3d& p_imu, const Cell& cell, const Residual& distance) const;
  double range_variance() const { return range_variance_; }

  Eigen::Vector3d in_map(const Eigen::Vector3d& p_imu) const { return R_ * p_imu + t_; }

  /// Calls `use(i, cell, chunk)` for each of some features (body frame) that `find(points, count, cells)`
  /// finds a cell for, given their places in the map; chunks side by side.
  template <typename Find, typename Use>
  void for_each_match(const std::vector<Eigen::Vector3d>& features, const Find& find, const Use& use) const;

  /// Sums the residuals that `add(i, cell, sum)` adds for each match, in an order that no number of threads
  /// changes.
  template <typename Find, typename Add>
  Sum sum_up(const std::vector<Eigen::Vector3d>& features, const Find& find, const Add& add) const;

  LidarInformation finish(const Eigen::Quaterniond& q_odom_imu, const Sum& sum) const;

 private:
  Vector6d jacobian(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& gradient) const;
  double point_variance(const Eigen::Vector3d& p_imu, const Eigen::Vector3d& n) const;
  double turned(const Eigen::Vector3d& p_imu, const Cell& cell, const Eigen::Vector3d& n) const;
  double view_variance(const Eigen::Vector3d& p_imu, const Cell& cell, const Eigen::Vector3d& n,
                       double depth_sigma_m) const;
  /// Distance along the cell's axis `normal`, which the cell knows no better than its points allow along its
  /// axes from `first_slope` on. `depth_sigma_m` is the deviation of errors of depth that all points have
  /// that are seen from one side.
  Residual distance(const Eigen::Vector3d& p_imu, const Cell& cell, int normal, int first_slope,
                    double depth_sigma_m) const;
  /// Variance of the error along the unit vector n (map frame) that the point shares with its neighbours:
  /// what the calibration of the beams leaves of elevation and range, and what its view and the cell's differ
  /// by.
  double shared_variance(const Eigen::Vector3d& p_imu, const Cell& cell, const Eigen::Vector3d& n) const;
  /// Variance along n of the error that all points of one beam have in the cell, and those of the next beam
  /// not.
  double beam_variance(const Cell& cell, const Eigen::Vector3d& n) const;

  const MappingConfig& mapping_;
  const MatchSettings& settings_;
  Eigen::Vector3d origin_;
  Eigen::Vector3d spin_axis_;
  Eigen::Matrix3d R_;
  Eigen::Vector3d t_;
  double range_variance_;
  double angle_variance_;
};

Residuals::Residuals(const Config& config, const MatchInput& input, const Eigen::Quaterniond& q_odom_imu,
                     const Eigen::Vector3d& t_odom_imu, const MatchSettings& settings)
    : mapping_(config.mapping),
      settings_(settings),
      origin_(input.origin),
      spin_axis_(input.spin_axis),
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

/// How far the cell was seen from another side than the point along the unit vector n (map frame): n . (v -
/// d) with the mean direction v to the cell's points and that of the beam, d.
double Residuals::turned(const Eigen::Vector3d& p_imu, const Cell& cell, const Eigen::Vector3d& n) const {
  return n.dot(cell.view) - (p_imu - origin_).normalized().dot(R_.transpose() * n);
}

/// What the point and those of the cell may differ by along the unit vector n (map frame), because they were
/// seen from different sides: an error of depth, which goes with the beam, is the same for all of a thing's
/// points that are seen from one side, and cancels there.
double Residuals::view_variance(const Eigen::Vector3d& p_imu, const Cell& cell, const Eigen::Vector3d& n,
                                double depth_sigma_m) const {
  return std::pow(depth_sigma_m * turned(p_imu, cell, n), 2);
}

void Residuals::add(const Eigen::Vector3d& p_imu, const Cell& cell, const Residual& residual, double weight,
                    Sum* sum) const {
  const double r = residual.value;
  if (r * r > settings_.max_deviation * settings_.max_deviation * residual.variance) return;
  const double fit = robust_weight(r, residual.variance, mapping_.robust_scale);
  const double information = weight * fit / residual.variance;
  const Vector6d J = jacobian(p_imu, residual.gradient);
  sum->products.add(information, J, r);
  if (residual.by_radius != 0.0) {
    const double weighted = information * residual.by_radius;
    sum->radius.information += weighted * residual.by_radius;
    sum->radius.gradient += weighted * r;
    sum->radius.with_pose += weighted * J;
  }
  const Eigen::Vector3d offset = in_map(p_imu) - cell.mean;
  for (int axis = residual.first_slope; axis < 3; ++axis) {
    if (cell.variances[axis] <= cell.variances[0]) continue;
    const double slope = residual.slope_variance / cell.variances[axis];
    sum->noise.add(information * slope, jacobian(p_imu, cell.axes.col(axis)),
                   cell.axes.col(axis).dot(offset));
  }
  sum->first_moment += p_imu;
  sum->second_moment += p_imu.squaredNorm();
  sum->squared_error += r * r;
  ++sum->count;
}

Residuals::Residual Residuals::distance(const Eigen::Vector3d& p_imu, const Cell& cell, int normal,
                                        int first_slope, double depth_sigma_m) const {
  const Eigen::Vector3d offset = in_map(p_imu) - cell.mean;
  Residual residual;
  residual.gradient = cell.axes.col(normal);
  residual.value = residual.gradient.dot(offset);
  residual.variance = point_variance(p_imu, residual.gradient) +
                      view_variance(p_imu, cell, residual.gradient, depth_sigma_m) +
                      cell.variances[normal] * (1.0 + leverage(cell, offset, normal) / cell.count);
  residual.slope_variance = std::max(cell.variances[normal], range_variance_) / cell.count;
  residual.first_slope = first_slope;
  return residual;
}

Residuals::Residual Residuals::plane(const Eigen::Vector3d& p_imu, const Cell& cell) const {
  Residual residual = distance(p_imu, cell, 0, 1, mapping_.range_bias_m);
  residual.slope_variance += beam_variance(cell, residual.gradient) / cell.beam_count();
  return residual;
}

Residuals::Residual Residuals::line(const Eigen::Vector3d& p_imu, const Cell& cell, int normal) const {
  Residual residual = distance(p_imu, cell, normal, 2, mapping_.line_radius_m);
  const double turn = turned(p_imu, cell, residual.gradient);
  residual.value -= settings_.line_radius_m * turn;
  if (std::abs(turn) <= kMostTurned) residual.by_radius = -turn;
  return residual;
}

Residuals::Residual Residuals::intensity(const Eigen::Vector3d& p_imu, double level, const Cell& cell) const {
  const Eigen::Vector3d offset = in_map(p_imu) - cell.mean;
  Residual residual;
  residual.gradient = cell.intensity_gradient;
  residual.value = cell.mean_intensity + residual.gradient.dot(offset) - level;
  const Eigen::Vector3d n = residual.gradient.normalized();
  residual.variance = cell.intensity_variance * (1.0 + leverage(cell, offset, 0) / cell.count) +
                      (point_variance(p_imu, n) + view_variance(p_imu, cell, n, mapping_.range_bias_m)) *
                          residual.gradient.squaredNorm();
  residual.slope_variance = cell.intensity_variance / cell.count;
  residual.first_slope = 1;
  return residual;
}

double Residuals::shared_variance(const Eigen::Vector3d& p_imu, const Cell& cell,
                                  const Eigen::Vector3d& n) const {
  const Eigen::Vector2d motion = beam_motions(p_imu - origin_, spin_axis_).transpose() * (R_.transpose() * n);
  const double range_m = mapping_.shared_range_error_m * motion[0];
  const double elevation_m = kRadians * mapping_.shared_elevation_error_deg * motion[1];
  // What is smooth from beam to beam nobody learns, nor what range errors come from the view. Both cancel
  // where the cell was seen as now.
  const double smooth_m = kRadians * mapping_.beam_elevation_sigma_deg * (motion[1] - n.dot(cell.lever));
  return elevation_m * elevation_m + range_m * range_m + smooth_m * smooth_m +
         view_variance(p_imu, cell, n, mapping_.range_bias_m);
}

double Residuals::beam_variance(const Cell& cell, const Eigen::Vector3d& n) const {
  const double elevation_m = kRadians * mapping_.beam_elevation_sigma_deg * n.dot(cell.lever);
  const double range_m = mapping_.range_bias_m * n.dot(cell.view);
  return kUnsmooth * kUnsmooth * (elevation_m * elevation_m + range_m * range_m);
}

PlaneMatch Residuals::plane_match(const Eigen::Vector3d& p_imu, const Cell& cell,
                                  const Residual& distance) const {
  PlaneMatch match;
  match.normal = distance.gradient;
  match.residual_m = distance.value;
  match.variance = distance.variance;
  match.jacobian = jacobian(p_imu, distance.gradient);
  match.shared_variance = shared_variance(p_imu, cell, distance.gradient);
  return match;
}

template <typename Find, typename Use>
void Residuals::for_each_match(const std::vector<Eigen::Vector3d>& features, const Find& find,
                               const Use& use) const {
  parallel_chunks(features.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t chunk) {
    std::vector<Eigen::Vector3d> places(end - begin);
    std::array<const Cell*, kChunk> cells{};
    for (std::size_t i = begin; i < end; ++i) places[i - begin] = in_map(features[i]);
    find(places.data(), end - begin, cells.data());
    for (std::size_t i = begin; i < end; ++i) {
      if (cells[i - begin] != nullptr) use(i, *cells[i - begin], chunk);
    }
  });
}

template <typename Find, typename Add>
Sum Residuals::sum_up(const std::vector<Eigen::Vector3d>& features, const Find& find, const Add& add) const {
  std::vector<Sum> sums((features.size() + kChunk - 1) / kChunk);
  for_each_match(features, find,
                 [&](std::size_t i, const Cell& cell, std::size_t chunk) { add(i, cell, &sums[chunk]); });
  Sum total;
  for (const Sum& sum : sums) total += sum;
  return total;
}

LidarInformation Residuals::finish(const Eigen::Quaterniond& q_odom_imu, const Sum& sum) const {
  LidarInformation information;
  information.q_odom_imu = q_odom_imu;
  information.t_odom_imu = t_;
  // Neighbouring residuals share the errors of the map and of the beam calibration.
  information.H = sum.products.H() / mapping_.correlation_factor;
  information.b = sum.products.b() / mapping_.correlation_factor;
  information.radius.information = sum.radius.information / mapping_.correlation_factor;
  information.radius.gradient = sum.radius.gradient / mapping_.correlation_factor;
  information.radius.with_pose = sum.radius.with_pose / mapping_.correlation_factor;
  information.bias = sum.noise.b() / mapping_.correlation_factor;
  information.noise_information = sum.noise.H() / mapping_.correlation_factor;
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
  const Residuals residuals(config_, input, q_odom_imu, t_odom_imu, settings);
  const auto add = [&](const Eigen::Vector3d& p, const Cell& cell, const Residuals::Residual& residual,
                       double weight, Sum* part) {
    if (std::abs(residual.value) <= settings.max_residual_m) residuals.add(p, cell, residual, weight, part);
  };
  const auto find_planes = [&](const Eigen::Vector3d* points, std::size_t count, const Cell** cells) {
    plane_map.find_planes(points, count, settings.wide, cells);
  };
  const auto find_lines = [&](const Eigen::Vector3d* points, std::size_t count, const Cell** cells) {
    edge_map.find_lines(points, count, cells);
  };
  Sum sum = residuals.sum_up(input.planes, find_planes, [&](std::size_t i, const Cell& cell, Sum* part) {
    const Eigen::Vector3d& p = input.planes[i];
    const double factor = input.plane_factors.empty() ? 1.0 : input.plane_factors[i];
    add(p, cell, residuals.plane(p, cell), settings.plane_weight * factor, part);
  });
  const std::size_t planes = sum.count;
  sum += residuals.sum_up(input.edges, find_lines, [&](std::size_t i, const Cell& cell, Sum* part) {
    const Eigen::Vector3d& p = input.edges[i];
    for (int axis = 0; axis < 2; ++axis)
      add(p, cell, residuals.line(p, cell, axis), settings.edge_weight, part);
  });
  LidarInformation information = residuals.finish(q_odom_imu, sum);
  information.planes = planes;
  information.edges = (sum.count - planes) / 2;
  return information;
}

std::vector<float> ScanMatcher::weigh_planes(const MatchInput& input, const VoxelMap& plane_map,
                                             const Eigen::Quaterniond& q_odom_imu,
                                             const Eigen::Vector3d& t_odom_imu,
                                             const Matrix6d& covariance) const {
  const MappingConfig& mapping = config_.mapping;
  const MatchSettings settings;
  const Residuals residuals(config_, input, q_odom_imu, t_odom_imu, settings);
  PlaneMatches found(input.planes.size());
  const auto find = [&](const Eigen::Vector3d* points, std::size_t count, const Cell** cells) {
    plane_map.find_planes(points, count, false, cells);
  };
  residuals.for_each_match(input.planes, find, [&](std::size_t i, const Cell& cell, std::size_t) {
    const Residuals::Residual residual = residuals.plane(input.planes[i], cell);
    if (std::abs(residual.value) <= mapping.max_residual_m)
      found[i] = residuals.plane_match(input.planes[i], cell, residual);
  });
  std::vector<float> factors(found.size(), 1.0F);
  if (mapping.judge_patches) {
    factors = trust_planes(input.planes, found,
                           {covariance, residuals.range_variance(), mapping.correlation_factor});
  }
  share_errors(input.planes, found, mapping.correlation_factor, &factors);
  return factors;
}

LidarInformation ScanMatcher::linearise_textures(const MatchInput& input, const VoxelMap& texture_map,
                                                 const Eigen::Quaterniond& q_odom_imu,
                                                 const Eigen::Vector3d& t_odom_imu,
                                                 const MatchSettings& settings) const {
  const Residuals residuals(config_, input, q_odom_imu, t_odom_imu, settings);
  const auto find = [&](const Eigen::Vector3d* points, std::size_t count, const Cell** cells) {
    texture_map.find_textures(points, count, cells);
  };
  const Sum sum = residuals.sum_up(input.textures, find, [&](std::size_t i, const Cell& cell, Sum* part) {
    const Eigen::Vector3d& p = input.textures[i];
    const Eigen::Vector3d offset = residuals.in_map(p) - cell.mean;
    if (squared_reach(cell, offset, 0) > kSquaredTextureReach) return;
    residuals.add(p, cell, residuals.intensity(p, input.levels[i], cell), settings.intensity_weight, part);
  });
  LidarInformation information = residuals.finish(q_odom_imu, sum);
  information.textures = sum.count;
  return information;
}

}  // namespace fdi_lio::matching
