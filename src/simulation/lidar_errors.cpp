#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/simulation/lidar_simulator.hpp"
#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/random_streams.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kDegree = M_PI / 180.0;

Eigen::Vector3d random_vector(double sigma, Random* random) {
  const double x = random->normal();
  const double y = random->normal();
  const double z = random->normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

}  // namespace

LidarErrors draw_lidar_errors(const Scenario& scenario, const LidarModel& model, std::uint64_t seed) {
  LidarErrors errors;
  errors.T_imu_lidar.translation() = scenario.lidar.t_imu_lidar;
  errors.T_imu_lidar.linear() = scenario.lidar.q_imu_lidar.toRotationMatrix();
  const std::size_t beams = model.beams.size();
  errors.elevation_rad.assign(beams, 0.0);
  errors.azimuth_rad.assign(beams, 0.0);
  errors.range_m.assign(beams, 0.0);
  errors.gain.assign(beams, 1.0);
  const ImperfectionSettings& sizes = scenario.imperfections;
  if (!sizes.enabled) return errors;
  Random random(seed, kStreamLidarErrors);
  for (std::size_t i = 0; i < beams; ++i) {
    errors.elevation_rad[i] = sizes.beam_elevation_deg * kDegree * random.normal();
    errors.azimuth_rad[i] = sizes.beam_azimuth_deg * kDegree * random.normal();
    errors.range_m[i] = sizes.beam_range_m * random.normal();
    errors.gain[i] = std::exp(sizes.beam_gain * random.normal());
  }
  errors.range_walk_m = sizes.range_walk_m;
  errors.mixed_share = sizes.mixed_share;
  errors.dropout = sizes.dropout;
  errors.time_offset_s = sizes.time_offset_s;
  errors.weak_signal_noise = true;
  // The sizes are those of the whole error vector, so each axis gets its share.
  const double per_axis = 1.0 / std::sqrt(3.0);
  const Eigen::Vector3d shift = random_vector(sizes.extrinsic_translation_m * per_axis, &random);
  const Eigen::Vector3d turn = random_vector(sizes.extrinsic_rotation_deg * kDegree * per_axis, &random);
  errors.T_imu_lidar.translation() += shift;
  errors.T_imu_lidar.linear() = errors.T_imu_lidar.linear() * so3::exp(turn);
  return errors;
}

}  // namespace fdi_lio::simulation
