#pragma once

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>

#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/mapping/external_odometry.hpp"
#include "fdi_lio/mapping/gnss_aligner.hpp"
#include "fdi_lio/scan/point_cloud_reader.hpp"

/// Between ROS messages and the types of the library.
namespace fdi_lio::ros_bridge {

/// A view of `cloud`, which must outlive it.
scan::RawCloud to_raw_cloud(const sensor_msgs::PointCloud2& cloud);

imu::ImuSample to_imu_sample(const sensor_msgs::Imu& message);

mapping::GnssFix to_gnss_fix(const sensor_msgs::NavSatFix& message);

/// A quaternion without length becomes a rotation of NaN.
mapping::ExternalPose to_external_pose(const nav_msgs::Odometry& message);

}  // namespace fdi_lio::ros_bridge
