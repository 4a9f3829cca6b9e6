#include "fdi_lio/ros/odometry_message.hpp"

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
  const Eigen::Vector3d t = state.t_odom_imu + arm;
  message.pose.pose.position.x = t.x();
  message.pose.pose.position.y = t.y();
  message.pose.pose.position.z = t.z();
  message.pose.pose.orientation.x = q.x();
  message.pose.pose.orientation.y = q.y();
  message.pose.pose.orientation.z = q.z();
  message.pose.pose.orientation.w = q.w();

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
  message.twist.twist.linear.x = v_base.x();
  message.twist.twist.linear.y = v_base.y();
  message.twist.twist.linear.z = v_base.z();
  message.twist.twist.angular.x = w_base.x();
  message.twist.twist.angular.y = w_base.y();
  message.twist.twist.angular.z = w_base.z();
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
