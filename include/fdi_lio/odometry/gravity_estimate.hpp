#pragma once

#include <Eigen/Core>

#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// Gravity in the frame of the states with what it is confused with, as one state of the smoother knows them.
struct GravityEstimate {
  /// [g_odom (m/s^2), bias of the accelerometer (IMU axes, m/s^2), NavState::mounting (rad)]
  Eigen::Matrix<double, 9, 1> value = Eigen::Matrix<double, 9, 1>::Zero();
  imu::Matrix9d covariance = imu::Matrix9d::Zero();
  double radius_m = 0.0;  ///< matching::LidarInformation::radius_m of that state; 0: nothing was matched
};

}  // namespace fdi_lio::odometry
