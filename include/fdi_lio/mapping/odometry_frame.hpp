#pragma once

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::mapping {

/// What the odometry said of a keyframe.
struct OdometryFrame {
  Stamp stamp = 0;
  Eigen::Isometry3d T_odom_imu = Eigen::Isometry3d::Identity();
  double path_m = 0.0;          ///< way since the first
  bool begins_session = false;  ///< no way leads here from the one before
};

}  // namespace fdi_lio::mapping
