#include "fdi_lio/ros/conversions.hpp"

#include <limits>

namespace fdi_lio::ros_bridge {

scan::RawCloud to_raw_cloud(const sensor_msgs::PointCloud2& cloud) {
  scan::RawCloud raw;
  raw.stamp = static_cast<Stamp>(cloud.header.stamp.toNSec());
  raw.frame_id = cloud.header.frame_id;
  raw.width = cloud.width;
  raw.height = cloud.height;
  raw.point_step = cloud.point_step;
  raw.row_step = cloud.row_step;
  raw.is_bigendian = cloud.is_bigendian != 0;
  for (const sensor_msgs::PointField& field : cloud.fields) {
    raw.fields.push_back({field.name, field.offset, field.datatype, field.count});
  }
  raw.data = cloud.data.data();
  raw.data_size = cloud.data.size();
  return raw;
}

imu::ImuSample to_imu_sample(const sensor_msgs::Imu& message) {
  imu::ImuSample sample;
  sample.stamp = static_cast<Stamp>(message.header.stamp.toNSec());
  sample.acceleration << message.linear_acceleration.x, message.linear_acceleration.y,
      message.linear_acceleration.z;
  sample.angular_velocity << message.angular_velocity.x, message.angular_velocity.y,
      message.angular_velocity.z;
  return sample;
}

mapping::GnssFix to_gnss_fix(const sensor_msgs::NavSatFix& message) {
  mapping::GnssFix fix;
  fix.stamp = static_cast<Stamp>(message.header.stamp.toNSec());
  fix.status = message.status.status;
  fix.latitude_deg = message.latitude;
  fix.longitude_deg = message.longitude;
  fix.altitude_m = message.altitude;
  fix.has_covariance = message.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
  fix.covariance =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(message.position_covariance.data());
  return fix;
}

mapping::ExternalPose to_external_pose(const nav_msgs::Odometry& message) {
  mapping::ExternalPose pose;
  pose.stamp = static_cast<Stamp>(message.header.stamp.toNSec());
  const auto& p = message.pose.pose.position;
  const auto& q = message.pose.pose.orientation;
  const Eigen::Quaterniond rotation(q.w, q.x, q.y, q.z);
  pose.T_world_child.translation() << p.x, p.y, p.z;
  if (rotation.norm() > 0.5) {
    pose.T_world_child.linear() = rotation.normalized().toRotationMatrix();
  } else {
    pose.T_world_child.linear().setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  // The messages have the translation first.
  for (int k = 0; k < 6; ++k) {
    const auto diagonal = static_cast<std::size_t>(7 * ((k + 3) % 6));
    pose.twist_variance[k] = message.twist.covariance[diagonal];
    pose.pose_variance[k] = message.pose.covariance[diagonal];
  }
  return pose;
}

}  // namespace fdi_lio::ros_bridge
