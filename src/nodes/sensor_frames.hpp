#pragma once

#include <optional>
#include <string>

#include <nav_msgs/Odometry.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

#include "fdi_lio/common/config.hpp"

namespace fdi_lio::nodes {

/// Where the sensors are on the robot: from the parameters, or from tf (`frames.extrinsics: tf`), and the
/// broadcasting of frames that nobody else owns.
class SensorFrames {
 public:
  SensorFrames(const Config& config, const ros::NodeHandle& handle);

  /// The IMU's frame as its messages name it; used for lookups in tf.
  void learn_imu_frame(const std::string& frame_id);

  /// T_base_imu; nothing while tf is asked and does not know it yet (a warning says so).
  std::optional<Eigen::Isometry3d> T_base_imu();

  /// The parameters with the T_imu_lidar of clouds of frame `lidar_frame`; nothing while tf does not know it
  /// yet. Without tf they are the parameters bit for bit, so that the nodes compute what offline_slam does.
  std::optional<Config> config_with_extrinsics(const std::string& lidar_frame);

  /// Publishes base_link -> IMU and lidar as static transforms, when `frames.sensor_tf` asks for it; with
  /// `auto` only when tf does not know the lidar. Does its work once.
  void publish_sensors(const std::string& lidar_frame);

  /// Sends odom -> base_link.
  void send_transform(const nav_msgs::Odometry& odometry);

 private:
  std::optional<Eigen::Isometry3d> look_up(const std::string& target, const std::string& source);
  /// What tf says, heard from the first call on.
  tf2_ros::Buffer& listen();

  Config config_;
  ros::NodeHandle handle_;
  std::string imu_frame_;
  tf2_ros::Buffer buffer_;
  /// Only while something is asked: every IMU reading sends a transform, which costs who listens.
  std::optional<tf2_ros::TransformListener> listener_;
  tf2_ros::TransformBroadcaster broadcaster_;
  tf2_ros::StaticTransformBroadcaster static_broadcaster_;
  std::optional<Eigen::Isometry3d> T_base_imu_;
  std::optional<Eigen::Isometry3d> T_imu_lidar_;
  std::optional<ros::SteadyTime> asked_since_;  ///< whether tf knows the lidar
  bool published_ = false;
};

}  // namespace fdi_lio::nodes
