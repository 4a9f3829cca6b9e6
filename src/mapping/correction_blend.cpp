#include "fdi_lio/mapping/correction_blend.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::mapping {

Eigen::Isometry3d CorrectionBlend::follow(Stamp stamp, const Eigen::Isometry3d& T_map_odom,
                                          const Eigen::Isometry3d& T_odom_imu) {
  if (T_map_odom_ && time_constant_s_ > 0.0) {
    const double step_s = std::max(0.0, seconds_between(stamp_, stamp));
    const double share = 1.0 - std::exp(-step_s / time_constant_s_);
    const Eigen::Isometry3d T_map_imu = *T_map_odom_ * T_odom_imu;
    const Vector6d rest = difference(T_map_imu, T_map_odom * T_odom_imu);
    // What is left of the smallest differences is not worth a new transform for ever.
    const bool is_there = rest.norm() < 1e-9;
    T_map_odom_ = is_there ? T_map_odom : moved(T_map_imu, share * rest) * T_odom_imu.inverse();
  } else {
    T_map_odom_ = T_map_odom;
  }
  stamp_ = stamp;
  return *T_map_odom_;
}

}  // namespace fdi_lio::mapping
