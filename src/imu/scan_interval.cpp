#include "fdi_lio/imu/scan_interval.hpp"

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/imu/propagation.hpp"

namespace fdi_lio::imu {

std::optional<Preintegration> preintegrate_scan_interval(const ImuBuffer& imu,
                                                         const std::optional<NavState>& state,
                                                         const std::optional<Stamp>& unanswered, Stamp to,
                                                         const Config& config) {
  if (imu.empty()) return std::nullopt;
  const bool has_state = state && !is_jump(state->stamp, to);
  const Stamp newest = has_state ? state->stamp : add_seconds(to, -config.imu.static_duration_s);
  const Stamp from = unanswered.value_or(newest);
  const ImuErrors errors = has_state ? state->errors() : ImuErrors();
  const double offset_s = errors.lidar_time_offset_s;
  const ImuStatistics recent = imu.statistics(add_seconds(to, offset_s), config.imu.static_duration_s);
  Preintegration result = preintegrate(imu.between(from, to, offset_s), from, to, errors,
                                       noise_of(config.sensor, recent), config.imu);
  result.recent = recent;
  return result;
}

NavState carried_on(const ImuBuffer& imu, const NavState& state, Stamp to, const Config& config) {
  if (state.imu_status == ImuStatus::kInitialised) {
    const auto interval = preintegrate_scan_interval(imu, state, std::nullopt, to, config);
    if (interval && interval->sample_count > 0 && interval->from == state.stamp)
      return predict(state, *interval);
  }
  return coast(state, to);
}

}  // namespace fdi_lio::imu
