#pragma once

#include <cstdint>
#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::imu {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix15d = Eigen::Matrix<double, 15, 15>;

/// One IMU reading in the IMU frame.
struct ImuSample {
  Stamp stamp = 0;
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();      ///< specific force [m/s^2]
  Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();  ///< [rad/s]
};

/// What is wrong with readings, w the true angular velocity and f the true specific force:
/// w = (I - gyro_scale) w_read - gyro_bias, f = f_read - accel_bias.
struct ImuErrors {
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< [rad/s]
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< [m/s^2]
  Eigen::Matrix3d gyro_scale =
      Eigen::Matrix3d::Zero();       ///< scales, and what the axes lean towards each other
  double lidar_time_offset_s = 0.0;  ///< NavState::lidar_time_offset_s

  Eigen::Vector3d angular_velocity(const Eigen::Vector3d& reading) const {
    return reading - gyro_scale * reading - gyro_bias;
  }
};

/// How much of the IMU the estimate already uses.
enum class ImuStatus : std::uint8_t {
  kNone = 0,          ///< no IMU data: constant velocity
  kInitialising = 1,  ///< gyro usable, gravity and velocity not yet known
  kInitialised = 2,   ///< gravity, velocity and biases are estimated
};

/// Everything needed to predict from one instant on.
struct NavState {
  Stamp stamp = 0;
  Eigen::Quaterniond q_odom_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d t_odom_imu = Eigen::Vector3d::Zero();
  Eigen::Vector3d v_odom = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< IMU frame [rad/s]
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< IMU frame [m/s^2]
  Eigen::Matrix3d gyro_scale = Eigen::Matrix3d::Zero();  ///< ImuErrors::gyro_scale
  Eigen::Vector3d g_odom = Eigen::Vector3d(0.0, 0.0, -9.81);
  /// Rotation vector from the pose's axes, which are those of the lidar turned by the stated T_imu_lidar, to
  /// the IMU's own [rad]: R_odom_imu Exp(mounting) is the attitude of the IMU.
  Eigen::Vector3d mounting = Eigen::Vector3d::Zero();
  /// Error of elevation that all beams of the lidar share, as far as it is not yet taken out of the scans
  /// [rad]: the map bends with it on the way.
  double beam_elevation = 0.0;
  /// What is to be added to the stamps of the scans, beyond sensor.lidar_time_offset, to get the clock of the
  /// IMU [s]: this state is that of the readings of stamp + lidar_time_offset.
  double lidar_time_offset_s = 0.0;
  Eigen::Vector3d w_imu = Eigen::Vector3d::Zero();  ///< bias-free angular velocity at `stamp` [rad/s]
  ImuStatus imu_status = ImuStatus::kNone;

  ImuErrors errors() const { return {gyro_bias, accel_bias, gyro_scale, lidar_time_offset_s}; }

  Eigen::Isometry3d T_odom_imu() const {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = q_odom_imu.toRotationMatrix();
    T.translation() = t_odom_imu;
    return T;
  }
};

/// Statistics of the readings in one stretch of time.
struct ImuStatistics {
  double duration_s = 0.0;
  std::uint32_t count = 0;
  Eigen::Vector3d mean_acceleration = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_angular_velocity = Eigen::Vector3d::Zero();
  double acceleration_std = 0.0;      ///< root of the summed variances of the three axes
  double angular_velocity_std = 0.0;  ///< root of the summed variances of the three axes
  /// White noise of one axis, vibration included (NoiseMeter); 0 with too few readings.
  double acceleration_noise = 0.0;      ///< [m/s^2/sqrt(Hz)]
  double angular_velocity_noise = 0.0;  ///< [rad/s/sqrt(Hz)]
};

/// Preintegrated IMU between two stamps (Forster et al., TRO 2017), expressed in the IMU frame at `from`.
struct Preintegration {
  Stamp from = 0;  ///< clock of the scans
  Stamp to = 0;
  /// Linearisation point: the readings are those from `from` + this to `to` + this.
  double lidar_time_offset_s = 0.0;
  Eigen::Quaterniond delta_q = Eigen::Quaterniond::Identity();  ///< rotation of `to` in `from`
  Eigen::Vector3d delta_v = Eigen::Vector3d::Zero();            ///< without gravity [m/s]
  Eigen::Vector3d delta_p = Eigen::Vector3d::Zero();            ///< without gravity and initial velocity [m]
  Matrix15d covariance = Matrix15d::Zero();  ///< order [dtheta, dp, dv, db_g, db_a]; biases: random walk
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< linearisation point
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< linearisation point
  Eigen::Matrix3d gyro_scale = Eigen::Matrix3d::Zero();  ///< linearisation point
  Eigen::Matrix3d dq_dbg = Eigen::Matrix3d::Zero();      ///< d Log(delta_q) / d gyro bias
  Eigen::Matrix3d dv_dbg = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d dv_dba = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d dp_dbg = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d dp_dba = Eigen::Matrix3d::Zero();
  Eigen::Vector3d dq_doffset = Eigen::Vector3d::Zero();  ///< d Log(delta_q) / d lidar_time_offset [rad/s]
  std::uint32_t sample_count = 0;                        ///< 0: no reading, a constant-velocity substitute
  double longest_gap_s = 0.0;                            ///< longest time without a reading
  Eigen::Vector3d last_angular_velocity = Eigen::Vector3d::Zero();  ///< raw reading at `to` [rad/s]
  ImuStatistics recent;  ///< the last second before `to`, for initialisation

  double duration_s() const { return seconds_between(from, to); }
  ImuErrors errors() const { return {gyro_bias, accel_bias, gyro_scale, lidar_time_offset_s}; }
};

}  // namespace fdi_lio::imu
