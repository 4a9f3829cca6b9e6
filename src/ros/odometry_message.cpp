#include "fdi_lio/ros/odometry_message.hpp"

#include <tf2_eigen/tf2_eigen.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/ros/message_conversions.hpp"

namespace fdi_lio::ros_bridge {

namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

void fill(const Matrix6d& covariance, boost::array<double, 36>* out) {
  Eigen::Map<Matrix6d>(out->data()) = covariance;
}

}  // namespace

nav_msgs::Odometry to_odometry(const imu::NavState& state, const Eigen::Isometry3d& T_base_imu,
                               const boost::array<double, 36>& covariance,
                               const boost::array<double, 9>& velocity_covariance, const SensorConfig& sensor,
                               const FrameConfig& frames) {
  nav_msgs::Odometry message;
  message.header.stamp = to_ros_time(state.stamp);
  message.header.frame_id = frames.odom;
  message.child_frame_id = frames.base_link;
  const Eigen::Isometry3d T_imu_base = T_base_imu.inverse();
  const Eigen::Matrix3d R_odom_imu = state.q_odom_imu.toRotationMatrix();
  const Eigen::Quaterniond q = (state.q_odom_imu * Eigen::Quaterniond(T_imu_base.rotation())).normalized();
  const Eigen::Vector3d arm = R_odom_imu * T_imu_base.translation();  // from the IMU to base_link, in odom
  message.pose.pose.position = tf2::toMsg(Eigen::Vector3d(state.t_odom_imu + arm));
  message.pose.pose.orientation = tf2::toMsg(q);

  // d t_base = d t_imu - arm x (R d theta); d rotation = R d theta, about the axes of odom.
  Matrix6d to_message = Matrix6d::Zero();
  to_message.block<3, 3>(0, 0) = -so3::hat(arm) * R_odom_imu;
  to_message.block<3, 3>(0, 3).setIdentity();
  to_message.block<3, 3>(3, 0) = R_odom_imu;
  const Eigen::Map<const Matrix6d> pose_covariance(covariance.data());
  fill(to_message * pose_covariance * to_message.transpose(), &message.pose.covariance);

  const Eigen::Matrix3d R_base_imu = T_base_imu.rotation();
  const Eigen::Vector3d w_base = R_base_imu * state.w_imu;
  const Eigen::Vector3d v_base =
      R_base_imu * (R_odom_imu.transpose() * state.v_odom) - w_base.cross(T_base_imu.translation());
  tf2::toMsg(v_base, message.twist.twist.linear);
  tf2::toMsg(w_base, message.twist.twist.angular);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> v_covariance(
      velocity_covariance.data());
  const Eigen::Matrix3d R_base_odom = R_base_imu * R_odom_imu.transpose();
  // One reading of the gyro at 100 Hz: its white noise over the bandwidth.
  constexpr double kRateHz = 100.0;
  Matrix6d twist_covariance = Matrix6d::Zero();
  twist_covariance.block<3, 3>(0, 0) = R_base_odom * v_covariance * R_base_odom.transpose();
  twist_covariance.block<3, 3>(3, 3) =
      sensor.gyro_noise * sensor.gyro_noise * kRateHz * Eigen::Matrix3d::Identity();
  fill(twist_covariance, &message.twist.covariance);
  return message;
}

}  // namespace fdi_lio::ros_bridge
