#include "sensor_frames.hpp"

#include <tf2_eigen/tf2_eigen.h>

namespace fdi_lio::nodes {

namespace {

/// How long a robot's own description has to show up before `auto` publishes the sensors' frames.
constexpr double kGraceS = 1.0;

geometry_msgs::TransformStamped transform(const Eigen::Isometry3d& T, const std::string& parent,
                                          const std::string& child, const ros::Time& stamp) {
  geometry_msgs::TransformStamped message = tf2::eigenToTransform(T);
  message.header.frame_id = parent;
  message.header.stamp = stamp;
  message.child_frame_id = child;
  return message;
}

}  // namespace

SensorFrames::SensorFrames(const Config& config, const ros::NodeHandle& handle)
    : config_(config), handle_(handle), imu_frame_(config.frames.imu) {
  if (config.frames.extrinsics == "parameters") {
    T_base_imu_ = config.frames.T_base_imu();
    T_imu_lidar_ = config.sensor.T_imu_lidar();
  } else {
    listen();  // so that tf is known by the time of the first scan
  }
}

void SensorFrames::learn_imu_frame(const std::string& frame_id) {
  if (!frame_id.empty()) imu_frame_ = frame_id;
}

tf2_ros::Buffer& SensorFrames::listen() {
  // In a thread of its own: time does not run yet when a recording waits to be started.
  if (!listener_) listener_.emplace(buffer_, handle_, true);
  return buffer_;
}

std::optional<Eigen::Isometry3d> SensorFrames::look_up(const std::string& target, const std::string& source) {
  std::string reason;
  if (listen().canTransform(target, source, ros::Time(0), &reason)) {
    const Eigen::Isometry3d T = tf2::transformToEigen(buffer_.lookupTransform(target, source, ros::Time(0)));
    listener_.reset();
    return T;
  }
  ROS_WARN_THROTTLE(5.0, "frames.extrinsics is tf, and tf does not know %s -> %s yet (%s)", target.c_str(),
                    source.c_str(), reason.c_str());
  return std::nullopt;
}

std::optional<Eigen::Isometry3d> SensorFrames::T_base_imu() {
  if (!T_base_imu_) T_base_imu_ = look_up(config_.frames.base_link, imu_frame_);
  return T_base_imu_;
}

std::optional<Config> SensorFrames::config_with_extrinsics(const std::string& lidar_frame) {
  if (!T_imu_lidar_) {
    T_imu_lidar_ = look_up(imu_frame_, lidar_frame);
    if (!T_imu_lidar_) return std::nullopt;
    config_.sensor.t_imu_lidar = T_imu_lidar_->translation();
    config_.sensor.q_imu_lidar = Eigen::Quaterniond(T_imu_lidar_->rotation());
  }
  return config_;
}

void SensorFrames::publish_sensors(const std::string& lidar_frame) {
  if (published_ || config_.frames.sensor_tf == "never" || !T_base_imu_ || !T_imu_lidar_) return;
  const std::string& base = config_.frames.base_link;
  if (config_.frames.sensor_tf == "auto") {
    if (!asked_since_) asked_since_ = ros::SteadyTime::now();
    published_ = listen().canTransform(base, lidar_frame, ros::Time(0));
    if (!published_ && (ros::SteadyTime::now() - *asked_since_).toSec() < kGraceS) return;
    listener_.reset();
    if (published_) return;
  }
  std::vector<geometry_msgs::TransformStamped> transforms;
  const ros::Time now = ros::Time::now();
  if (imu_frame_ != base && imu_frame_ != lidar_frame)
    transforms.push_back(transform(*T_base_imu_, base, imu_frame_, now));
  if (lidar_frame != base)
    transforms.push_back(transform(*T_base_imu_ * *T_imu_lidar_, base, lidar_frame, now));
  static_broadcaster_.sendTransform(transforms);
  published_ = true;
}

void SensorFrames::send_transform(const nav_msgs::Odometry& odometry) {
  geometry_msgs::TransformStamped message;
  message.header = odometry.header;
  message.child_frame_id = odometry.child_frame_id;
  message.transform.translation.x = odometry.pose.pose.position.x;
  message.transform.translation.y = odometry.pose.pose.position.y;
  message.transform.translation.z = odometry.pose.pose.position.z;
  message.transform.rotation = odometry.pose.pose.orientation;
  broadcaster_.sendTransform(message);
}

}  // namespace fdi_lio::nodes
