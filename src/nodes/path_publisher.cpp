#include "path_publisher.hpp"

#include <utility>

#include <geometry_msgs/PoseArray.h>
#include <nav_msgs/Path.h>
#include <tf2_eigen/tf2_eigen.h>

#include "fdi_lio/ros/message_conversions.hpp"

namespace fdi_lio::nodes {

PathPublisher::PathPublisher(ros::NodeHandle handle, std::string map_frame, std::size_t limit)
    : path_(handle.advertise<nav_msgs::Path>("path", 1, true)),
      keyframes_(handle.advertise<geometry_msgs::PoseArray>("keyframes", 1, true)),
      map_frame_(std::move(map_frame)),
      limit_(limit) {}

void PathPublisher::publish(std::size_t size,
                            const std::function<evaluation::StampedPose(std::size_t)>& pose) const {
  nav_msgs::Path path;
  path.header.frame_id = map_frame_;
  geometry_msgs::PoseArray keyframes;
  std::size_t step = 1;
  while (size / step > limit_) step *= 2;
  const auto add = [&](std::size_t k) {
    const evaluation::StampedPose T_map_base = pose(k);
    geometry_msgs::PoseStamped message;
    message.header.frame_id = map_frame_;
    message.header.stamp = ros_bridge::to_ros_time(T_map_base.stamp);
    message.pose = tf2::toMsg(T_map_base.T);
    path.header.stamp = message.header.stamp;
    keyframes.poses.push_back(message.pose);
    path.poses.push_back(std::move(message));
  };
  for (std::size_t k = 0; k + 1 < size; k += step) add(k);
  if (size > 0) add(size - 1);
  path_.publish(path);
  keyframes.header = path.header;
  keyframes_.publish(keyframes);
}

}  // namespace fdi_lio::nodes
