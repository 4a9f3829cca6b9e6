#pragma once

#include <optional>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// The work of the imu_preintegration node for one scan: readings from the newest estimate `state` to the
/// scan's stamp `to`, preintegrated at the biases of `state`, with the statistics of the last
/// `imu.static_duration` seconds. Before the first estimate the interval is that stretch. `unanswered`: stamp
/// of the scan before, if its estimate is still to come; the interval begins there. Nothing when the buffer
/// has never held a reading.
std::optional<Preintegration> preintegrate_scan_interval(const ImuBuffer& imu,
                                                         const std::optional<NavState>& state,
                                                         const std::optional<Stamp>& unanswered, Stamp to,
                                                         const Config& config);

/// `state`, not newer than `to`, carried on to there by the readings, or with constant velocity where there
/// are none or the IMU is not initialised.
NavState carried_on(const ImuBuffer& imu, const NavState& state, Stamp to, const Config& config);

}  // namespace fdi_lio::imu
