#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::mapping {

/// Makes map -> odom follow new corrections smoothly: of what the robot would jump by, the share
/// 1 - exp(-dt / time constant) is made up in each step. The way between is that of the robot, not of the
/// origin of odom, which may be far away and would swing it about.
class CorrectionBlend {
 public:
  /// 0: follows at once.
  explicit CorrectionBlend(double time_constant_s) : time_constant_s_(time_constant_s) {}

  /// The correction to publish at `stamp`, when `T_map_odom` is the newest one that is known and the robot is
  /// at `T_odom_imu`. The first one is taken as it is.
  Eigen::Isometry3d follow(Stamp stamp, const Eigen::Isometry3d& T_map_odom,
                           const Eigen::Isometry3d& T_odom_imu);

  /// The next correction will be taken as it is.
  void reset() { T_map_odom_.reset(); }

 private:
  double time_constant_s_;
  std::optional<Eigen::Isometry3d> T_map_odom_;
  Stamp stamp_ = 0;
};

}  // namespace fdi_lio::mapping
