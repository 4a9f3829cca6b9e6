#pragma once

#include <Eigen/Geometry>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::odometry {

/// Covariance of T_odom_now, order [dtheta (body), dt (odom)], that comes from a rotation of T_imu_lidar that
/// is wrong by an unknown delta (IMU axes, `sigma_rad` about each).
///
/// Registration gives the way of the lidar, L = T_il^-1 T_rel T_il. Seen through a wrong T_il, the way of the
/// IMU since `T_odom_first` comes out turned: T_rel' = Exp(-delta) T_rel Exp(delta), so that
///   dtheta = (R_rel' - I) delta,  dt = R_first (delta x t_rel),
/// 0.2 degrees are 1.4 m after 400 m. What the lever arm does is smaller than a scan's noise and left out.
Matrix6d mounting_covariance(const Eigen::Isometry3d& T_odom_first, const Eigen::Isometry3d& T_odom_now,
                             double sigma_rad);

/// The rotation of T_imu_lidar that a mounting found by the smoother (imu::NavState::mounting) stands for:
/// R_il' = Exp(mounting)' R_il.
Eigen::Quaterniond corrected_rotation(const Eigen::Quaterniond& q_imu_lidar, const Eigen::Vector3d& mounting);

}  // namespace fdi_lio::odometry
