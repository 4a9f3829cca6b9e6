#include "fdi_lio/odometry/mounting.hpp"

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::odometry {

Matrix6d mounting_covariance(const Eigen::Isometry3d& T_odom_first, const Eigen::Isometry3d& T_odom_now,
                             double sigma_rad) {
  const Eigen::Isometry3d T_rel = T_odom_first.inverse() * T_odom_now;
  Eigen::Matrix<double, 6, 3> J;
  J.topRows<3>() = T_rel.linear().transpose() - Eigen::Matrix3d::Identity();
  J.bottomRows<3>() = -T_odom_first.linear() * so3::hat(T_rel.translation());
  return sigma_rad * sigma_rad * J * J.transpose();
}

Eigen::Quaterniond corrected_rotation(const Eigen::Quaterniond& q_imu_lidar,
                                      const Eigen::Vector3d& mounting) {
  return (so3::exp_q(mounting).conjugate() * q_imu_lidar).normalized();
}

}  // namespace fdi_lio::odometry
