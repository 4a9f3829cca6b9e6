#pragma once

#include <optional>

#include <Eigen/Core>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// What the poses in `odom` are off by because the local map tilts on the way, as far as gravity shows it.
///
/// Scans are matched to what the ones before left, so that errors of the beams turn the map little by little.
/// The smoother lets gravity in the frame of the states follow (`mapping.tilt_walk`), but poses stay in that
/// frame, or odometry would jump. With g_0 where the tilt began and g now, both in `odom`, the frame has
/// turned by phi = g_0 x g / |g|^2, and
///
///     R_est' R_true = Exp(-R_est' phi),   t_true - t_est = sum of -phi x step
///
/// The tilt counts from the end of the first 20 m on: until then gravity itself is being found.
class MapTilt {
 public:
  /// Moves on from one pose to the next. Without gravity (no IMU) nothing is known.
  void advance(const imu::NavState& before, const imu::NavState& now);

  /// Error of T_odom_imu at the newest pose, order [dtheta (body), dt (odom)].
  const Vector6d& error() const { return error_; }

 private:
  double way_m_ = 0.0;  ///< since gravity is known
  std::optional<Eigen::Vector3d> g_begin_;
  Vector6d error_ = Vector6d::Zero();
};

}  // namespace fdi_lio::odometry
