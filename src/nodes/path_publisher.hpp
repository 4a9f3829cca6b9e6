#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include <ros/ros.h>

#include "fdi_lio/evaluation/trajectory_writer.hpp"

namespace fdi_lio::nodes {

/// Publishes the way so far, on `path` (nav_msgs/Path) and `keyframes` (geometry_msgs/PoseArray).
class PathPublisher {
 public:
  /// At most about `limit` poses are sent.
  PathPublisher(ros::NodeHandle handle, std::string map_frame, std::size_t limit);

  /// `pose(k)` for k < `size` is T_map_base of keyframe k. Beyond the limit every second, fourth, ... and the
  /// newest are sent.
  void publish(std::size_t size, const std::function<evaluation::StampedPose(std::size_t)>& pose) const;

 private:
  ros::Publisher path_, keyframes_;
  std::string map_frame_;
  std::size_t limit_;
};

}  // namespace fdi_lio::nodes
