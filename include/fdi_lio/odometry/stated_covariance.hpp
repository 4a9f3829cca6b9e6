#pragma once

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/map_drift.hpp"
#include "fdi_lio/odometry/map_tilt.hpp"

namespace fdi_lio::odometry {

/// What the poses may be off by since the start, as it is published: the registration against the local map,
/// the drift of that map, an unknown error of the mounting, the tilt that gravity shows, and what the
/// velocity may have been off by. docs/odometry.md (Covariance) has the sum.
class StatedCovariance {
 public:
  explicit StatedCovariance(const Config& config);

  /// The first pose since the start.
  void begin(const imu::NavState& first) { T_odom_first_ = first.T_odom_imu(); }

  /// Moves on from one pose to the next, `map_covariance` that of `now` against the local map, `radius_m` the
  /// size of the features matched.
  void advance(const imu::NavState& before, const imu::NavState& now, const Matrix6d& map_covariance,
               double radius_m);

  /// The local map is begun anew at a pose with this covariance against the one of before.
  void begin_map_anew(const Matrix6d& map_covariance) { drift_.begin_anew(map_covariance); }

  /// Of `now`, order [dtheta (body), dt (odom)]. `noise_scale`: AdaptedSettings'; `watched`: that of the
  /// position by BrightnessWatch.
  Matrix6d covariance(const imu::NavState& now, const Matrix6d& map_covariance, double noise_scale,
                      const Eigen::Matrix3d& watched) const;

 private:
  double factor_;
  double mounting_sigma_rad_;
  MapDrift drift_;
  MapTilt tilt_;
  Eigen::Isometry3d T_odom_first_ = Eigen::Isometry3d::Identity();
};

}  // namespace fdi_lio::odometry
