#include "simulated_messages.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include <tf2_eigen/tf2_eigen.h>

#include "fdi_lio/ros/message_conversions.hpp"

namespace fdi_lio::tools {

using ros_bridge::to_ros_time;

namespace {

constexpr double kUnknownVariance = 1e6;

}  // namespace

sensor_msgs::PointCloud2 to_message(simulation::EncodedCloud cloud, Stamp stamp, const std::string& frame) {
  sensor_msgs::PointCloud2 message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = frame;
  message.height = cloud.height;
  message.width = cloud.width;
  message.point_step = cloud.point_step;
  message.row_step = cloud.point_step * cloud.width;
  message.is_dense = cloud.is_dense;
  message.data = std::move(cloud.data);
  for (const simulation::EncodedField& field : cloud.fields) {
    sensor_msgs::PointField f;
    f.name = field.name;
    f.offset = field.offset;
    f.datatype = field.datatype;
    f.count = 1;
    message.fields.push_back(f);
  }
  return message;
}

sensor_msgs::Imu to_message(const simulation::ImuReading& reading, const simulation::ImuSettings& settings,
                            Stamp stamp) {
  sensor_msgs::Imu message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = "imu_link";
  message.angular_velocity.x = reading.gyro.x();
  message.angular_velocity.y = reading.gyro.y();
  message.angular_velocity.z = reading.gyro.z();
  message.linear_acceleration.x = reading.accel.x();
  message.linear_acceleration.y = reading.accel.y();
  message.linear_acceleration.z = reading.accel.z();
  const bool oriented = settings.nine_axis;
  message.orientation.w = oriented ? reading.orientation.w() : 0.0;
  message.orientation.x = oriented ? reading.orientation.x() : 0.0;
  message.orientation.y = oriented ? reading.orientation.y() : 0.0;
  message.orientation.z = oriented ? reading.orientation.z() : 0.0;
  for (std::size_t i = 0; i < 9; i += 4) {
    message.angular_velocity_covariance[i] = settings.gyro_noise * settings.gyro_noise * settings.rate_hz;
    message.linear_acceleration_covariance[i] =
        settings.accel_noise * settings.accel_noise * settings.rate_hz;
    message.orientation_covariance[i] = oriented ? 2.5e-5 : 0.0;
  }
  if (!oriented) message.orientation_covariance[0] = -1.0;
  return message;
}

nav_msgs::Odometry to_message(const simulation::MotionState& state, Stamp stamp) {
  nav_msgs::Odometry message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = "map";
  message.child_frame_id = "imu_link";
  message.pose.pose = tf2::toMsg(state.T_map_imu);
  tf2::toMsg(state.T_map_imu.linear().transpose() * state.v_map, message.twist.twist.linear);
  tf2::toMsg(state.w_imu, message.twist.twist.angular);
  return message;
}

nav_msgs::Odometry to_message(const simulation::WheelReading& reading,
                              const simulation::WheelSettings& settings, Stamp stamp) {
  nav_msgs::Odometry message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = "odom_wheels";
  message.child_frame_id = "imu_link";
  message.pose.pose = tf2::toMsg(reading.T_start_imu);
  message.twist.twist.linear.x = reading.speed_mps;
  message.twist.twist.angular.z = reading.yaw_rate_radps;
  // As drivers of planar odometry do: what they do not know has a huge variance.
  for (const std::size_t axis : {std::size_t{2}, std::size_t{3}, std::size_t{4}}) {
    message.pose.covariance[7 * axis] = kUnknownVariance;
    message.twist.covariance[7 * axis] = kUnknownVariance;
  }
  const double speed_sigma = settings.scale_error * std::abs(reading.speed_mps);
  message.twist.covariance[0] = speed_sigma * speed_sigma;
  return message;
}

sensor_msgs::NavSatFix to_message(const simulation::GnssFix& fix, const simulation::GnssSettings& settings,
                                  Stamp stamp) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  sensor_msgs::NavSatFix message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = "imu_link";
  message.status.status =
      fix.valid ? sensor_msgs::NavSatStatus::STATUS_FIX : sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  message.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  message.latitude = fix.valid ? fix.latitude_deg : kNan;
  message.longitude = fix.valid ? fix.longitude_deg : kNan;
  message.altitude = fix.valid ? fix.altitude_m : kNan;
  const double variance = settings.noise_m * settings.noise_m + settings.drift_m * settings.drift_m;
  message.position_covariance[0] = message.position_covariance[4] = variance;
  message.position_covariance[8] = 9.0 * variance;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN;
  return message;
}

}  // namespace fdi_lio::tools
