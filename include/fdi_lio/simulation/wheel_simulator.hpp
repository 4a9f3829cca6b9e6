#pragma once

#include <cstdint>

#include <Eigen/Geometry>

#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

/// What wheels say at one instant.
struct WheelReading {
  double time_s = 0.0;                                            ///< since the start of the recording
  Eigen::Isometry3d T_start_imu = Eigen::Isometry3d::Identity();  ///< planar: no z, roll and pitch
  double speed_mps = 0.0;                                         ///< forward
  double yaw_rate_radps = 0.0;
};

/// Dead reckoning by wheels: the way forward with an error of scale (drawn once) and noise that grows with
/// the way, the turn about the vehicle's own axis with noise of its own. Knows nothing of slopes.
class WheelSimulator {
 public:
  /// Keeps a reference to `trajectory`.
  WheelSimulator(const Trajectory& trajectory, const WheelSettings& settings, std::uint64_t seed);

  /// The next reading; the first is at t = 0, at the origin.
  WheelReading next();

 private:
  const Trajectory& trajectory_;
  WheelSettings settings_;
  std::uint64_t seed_;
  double scale_;
  std::int64_t count_ = 0;
  WheelReading reading_;
};

}  // namespace fdi_lio::simulation
