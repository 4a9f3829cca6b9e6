#pragma once

#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// Continuous noise of the IMU.
struct ImuNoise {
  double gyro = 1e-3;             ///< [rad/s/sqrt(Hz)]
  double accel = 1e-2;            ///< [m/s^2/sqrt(Hz)]
  double gyro_bias_walk = 1e-4;   ///< [rad/s^2/sqrt(Hz)]
  double accel_bias_walk = 1e-3;  ///< [m/s^3/sqrt(Hz)]
  double gyro_seen = 0.0;         ///< white noise that the readings show, without any margin [rad/s/sqrt(Hz)]
};

/// The walk of the accelerometer's bias holds `sensor.accel_model_walk` too: what scale factors, axes,
/// mounting and clocks do to the acceleration changes with the motion, and a data sheet's bias walk knows
/// nothing of it. Taken for constant, such errors are averaged into a bias and a direction of gravity that
/// are both wrong by the same, and part at the next turn. White noise is three times what the readings
/// show where that is more than the parameters say: an engine shakes the IMU by many times its data sheet,
/// and not quite as white noise would.
ImuNoise noise_of(const SensorConfig& sensor, const ImuStatistics& recent);

/// Whether vibration drowns the readings: white noise of more than three times what the parameters say.
bool is_shaken(const SensorConfig& sensor, const ImuStatistics& recent);

/// Preintegrates readings over [from, to] (Forster et al., TRO 2017, eqs. 33-35, 63; midpoint rule).
/// about `errors`. `samples` must be in time order; the first at or before `from` and the first at or after
/// `to` are used for interpolation, and where they are missing the nearest reading is held. A stretch without
/// readings longer than `config.max_gap_s` is bridged with the held mean of its ends and the covariance of
/// `gap_*_noise`. Without any reading: `sample_count` is 0 and nothing else is filled; use
/// `constant_velocity`.
Preintegration preintegrate(const std::vector<ImuSample>& samples, Stamp from, Stamp to,
                            const ImuErrors& errors, const ImuNoise& noise, const ImuConfig& config);

/// The constant-velocity model from `state` on, in the form of a preintegration: rotation by the state's
/// angular velocity, no change of velocity (gravity must not be added), no dependence on the biases.
Preintegration constant_velocity(const NavState& state, Stamp to, const ImuConfig& config);

/// A preintegration whose rotation comes from the gyro and whose translation is that of constant velocity:
/// all that can be used while gravity is unknown.
Preintegration gyro_only(const Preintegration& measured, const ImuConfig& config);

/// By what a motion may be off besides, in whatever instant of the interval (standard deviations).
struct MotionError {
  double turn_rad = 0.0;      ///< about each axis, and with it what the accelerometer felt
  double velocity_mps = 0.0;  ///< of the change of velocity along each axis
};
Preintegration with_error(const Preintegration& measured, const MotionError& error);

/// The motion with a turn besides that the gyro has missed [rad], evenly over the interval or not quite: as
/// uncertain as it is large.
Preintegration with_missed_turn(const Preintegration& measured, const Eigen::Vector3d& turn);

/// One preintegration of two that follow each other (`first.to` is `second.from`, both with readings), at the
/// biases and the time offset of the first: what preintegrating all their readings gives; exact, but for
/// biases and offsets that differ, for which `corrected` stands.
Preintegration joined(const Preintegration& first, const Preintegration& second);

/// Mean reading of the gyro in the interval [rad/s]: a change of ImuErrors::gyro_scale acts like one of the
/// bias by change * mean_reading.
Eigen::Vector3d mean_reading(const Preintegration& preintegration);

/// Preintegrated terms at other errors of the IMU, to first order (Forster eq. 44), and at another time
/// offset: of the rotation alone, since the readings of the next scan are taken with the new offset anyway.
struct CorrectedDelta {
  Eigen::Quaterniond delta_q;
  Eigen::Vector3d delta_v;
  Eigen::Vector3d delta_p;
};
CorrectedDelta corrected(const Preintegration& preintegration, const ImuErrors& errors);

/// The state at `preintegration.to`, predicted from `state` (at `preintegration.from`).
NavState predict(const NavState& state, const Preintegration& preintegration);

/// The same by a motion that is not one of an accelerometer (`constant_velocity`, `gyro_only`), in the axes
/// of the pose.
NavState predict_without_gravity(const NavState& state, const Preintegration& motion);

}  // namespace fdi_lio::imu
