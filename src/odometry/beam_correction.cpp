#include "fdi_lio/odometry/beam_correction.hpp"

#include <cmath>

namespace fdi_lio::odometry {

namespace {

constexpr std::size_t kSamples = 4000;    ///< points of a scan that errors are learned from
constexpr std::uint32_t kLeastScans = 5;  ///< that a plane must have been seen by before it teaches
constexpr double kMostDeviationSq = 9.0;  ///< of a residual, in its variances
constexpr double kRadians = M_PI / 180.0;

BeamCalibrationConfig beam_config(const MappingConfig& mapping) {
  BeamCalibrationConfig config;
  config.range_sigma_m = mapping.beam_range_sigma_m;
  config.angle_sigma_rad = mapping.beam_elevation_sigma_deg * kRadians;
  config.correlation_factor = mapping.correlation_factor;
  return config;
}

/// The point relative to where the sensor was when it fired; the turn of the sensor since then, some degrees,
/// is left out.
Eigen::Vector3d beam_of(const Point& point, const Eigen::Vector3d& v_lidar) {
  return point.position.cast<double>() - static_cast<double>(point.time_s) * v_lidar;
}

}  // namespace

BeamCorrection::BeamCorrection(const Config& config)
    : beams_(beam_config(config.mapping)),
      T_imu_lidar_(config.sensor.T_imu_lidar()),
      range_variance_m2_(std::pow(config.sensor.range_noise_m, 2)) {}

/// Velocity of the lidar in its own axes.
Eigen::Vector3d BeamCorrection::v_lidar(const imu::NavState& state) const {
  const Eigen::Vector3d v_imu = state.q_odom_imu.conjugate() * state.v_odom;
  return T_imu_lidar_.linear().transpose() * (v_imu + state.w_imu.cross(T_imu_lidar_.translation()));
}

FeatureSet BeamCorrection::apply(FeatureSet features, const imu::NavState& state) const {
  const Eigen::Vector3d velocity = v_lidar(state);
  for (std::vector<Point>* points : {&features.planes, &features.edges, &features.intensity_edges}) {
    for (Point& point : *points) {
      point.position += beams_.correction(point.ring, beam_of(point, velocity)).cast<float>();
    }
  }
  return features;
}

void BeamCorrection::learn(const FeatureSet& corrected, const imu::NavState& state,
                           const matching::VoxelMap& plane_map) {
  const Eigen::Isometry3d T_odom_lidar = state.T_odom_imu() * T_imu_lidar_;
  const Eigen::Vector3d velocity = v_lidar(state);
  const std::size_t stride = 1 + corrected.planes.size() / kSamples;
  for (std::size_t k = 0; k < corrected.planes.size(); k += stride) {
    const Point& point = corrected.planes[k];
    const Eigen::Vector3d p_odom = T_odom_lidar * point.position.cast<double>();
    const matching::Cell* cell = plane_map.find_plane(p_odom, false);
    if (cell == nullptr || cell->scans < kLeastScans) continue;
    const Eigen::Vector3d normal = cell->axes.col(0);
    const double residual = normal.dot(p_odom - cell->mean);
    const double variance = range_variance_m2_ + cell->variances[0];
    if (residual * residual > kMostDeviationSq * variance) continue;
    beams_.observe(point.ring, beam_of(point, velocity), T_odom_lidar.linear().transpose() * normal, residual,
                   variance);
  }
  beams_.update();
}

}  // namespace fdi_lio::odometry
