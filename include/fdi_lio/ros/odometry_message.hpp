#pragma once

#include <boost/array.hpp>
#include <nav_msgs/Odometry.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::ros_bridge {

/// Odometry of base_link in odom. The twist is in base_link, as REP-147 and nav_msgs ask, with its lever arm:
///   v_base = R_base_imu R_odom_imu^T v_odom + (R_base_imu w_imu) x (-t_base_imu).
/// `covariance` is that of T_odom_imu (rotation in body axes, translation in odom axes, row by row),
/// `velocity_covariance` that of v_odom; both are turned into the message's axes and order.
nav_msgs::Odometry to_odometry(const imu::NavState& state, const Eigen::Isometry3d& T_base_imu,
                               const boost::array<double, 36>& covariance,
                               const boost::array<double, 9>& velocity_covariance, const SensorConfig& sensor,
                               const FrameConfig& frames);

}  // namespace fdi_lio::ros_bridge
