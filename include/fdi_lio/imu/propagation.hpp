#pragma once

#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// `state` moved by one reading interval with the mean of both readings (midpoint rule). Before the IMU is
/// initialised the velocity is held and only the gyro is used.
NavState step(const NavState& state, const ImuSample& before, const ImuSample& after);

/// `state` moved to `to` with constant velocity and angular velocity.
NavState coast(const NavState& state, Stamp to);

/// States at `from.stamp`, at every reading in (from.stamp, to) and at `to`, in time order. Without readings:
/// constant velocity.
std::vector<NavState> propagate(const NavState& from, const std::vector<ImuSample>& samples, Stamp to);

/// IMU-rate odometry: holds the newest estimate and moves it with every reading. Its stamps are those of the
/// IMU's clock.
class ImuPropagator {
 public:
  ImuPropagator() = default;

  /// Takes the newest estimate and moves it over the readings in `buffer` that are newer. An estimate from
  /// before a jump of the stamps (is_jump) is forgotten.
  void set_state(const NavState& state, const ImuBuffer& buffer);

  /// Moves to `sample` (the newest reading of the buffer). Nothing before the first estimate.
  std::optional<NavState> add(const ImuSample& sample);

  void reset();

 private:
  std::optional<NavState> state_;
  std::optional<ImuSample> last_sample_;
};

}  // namespace fdi_lio::imu
