#pragma once

#include <Eigen/Core>

#include "fdi_lio/odometry/smoother.hpp"

namespace fdi_lio::odometry {

/// What the first scans say together of a start in motion.
struct MovingStart {
  Eigen::Vector3d v_odom = Eigen::Vector3d::Zero();      ///< at the first scan [m/s]
  Eigen::Vector3d up_odom = Eigen::Vector3d::UnitZ();    ///< unit vector
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();   ///< [rad/s]
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();  ///< [m/s^2]
  Smoother::InitialSigma sigma;                          ///< of all this
};

}  // namespace fdi_lio::odometry
