#include "fdi_lio/imu/scan_interval.hpp"

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::imu {

std::optional<Preintegration> preintegrate_scan_interval(const ImuBuffer& imu,
                                                         const std::optional<NavState>& state,
                                                         const std::optional<Stamp>& unanswered, Stamp to,
                                                         const Config& config) {
  if (imu.empty()) return std::nullopt;
  const bool has_state = state && !is_jump(state->stamp, to);
  const Stamp newest = has_state ? state->stamp : add_seconds(to, -config.imu.static_duration_s);
  const Stamp from = unanswered.value_or(newest);
  const NavState neutral;
  const NavState& biases = has_state ? *state : neutral;
  const double offset_s = biases.lidar_time_offset_s;
  const ImuStatistics recent = imu.statistics(add_seconds(to, offset_s), config.imu.static_duration_s);
  Preintegration result = preintegrate(imu.between(from, to, offset_s), from, to, biases.gyro_bias,
                                       biases.accel_bias, noise_of(config.sensor, recent), config.imu);
  result.lidar_time_offset_s = offset_s;
  result.recent = recent;
  return result;
}

}  // namespace fdi_lio::imu
