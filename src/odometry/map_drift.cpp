#include "fdi_lio/odometry/map_drift.hpp"

#include <algorithm>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr double kLeastRadius = 1.0;  ///< [m]

}  // namespace

void MapDrift::advance(const imu::NavState& before, const imu::NavState& now, const Matrix6d& covariance,
                       double radius_m) {
  const Eigen::Matrix3d R_before = before.q_odom_imu.toRotationMatrix();
  const Eigen::Matrix3d R_now = now.q_odom_imu.toRotationMatrix();
  const Eigen::Vector3d step = now.t_odom_imu - before.t_odom_imu;
  // An error of the earlier heading swings the later position: t' = t + R Exp(dtheta) R' step.
  Matrix6d F = Matrix6d::Identity();
  F.topLeftCorner<3, 3>() = R_now.transpose() * R_before;
  F.bottomLeftCorner<3, 3>() = -so3::hat(step) * R_before;
  covariance_ = F * covariance_ * F.transpose();
  const Eigen::Vector3d up = -(R_now.transpose() * now.g_odom).normalized();
  Matrix6d heading_and_place = Matrix6d::Identity();
  heading_and_place.topLeftCorner<3, 3>() = up * up.transpose();
  const double entering = share_ * step.norm() / std::max(radius_m, kLeastRadius);
  covariance_ += entering * heading_and_place * covariance * heading_and_place.transpose();
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
}

}  // namespace fdi_lio::odometry
