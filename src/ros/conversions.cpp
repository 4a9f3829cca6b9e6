#include "fdi_lio/ros/conversions.hpp"

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

}  // namespace fdi_lio::ros_bridge
