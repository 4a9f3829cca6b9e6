#pragma once

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// Uncertainty of the local map against the origin of `odom`.
///
/// Registration says where a scan is in the local map, and that map was built from earlier poses: their
/// errors stay in it. On the way of one feature radius L the map about the sensor is replaced by what was
/// added meanwhile, so that the share ds / L of the pose's own covariance enters the map on a way ds. Roll
/// and pitch do not enter: gravity holds them.
class MapDrift {
 public:
  /// `share` scales the part that enters.
  explicit MapDrift(double share) : share_(share) {}

  /// Moves on from one pose to the next. `covariance` is that of `now` against the local map, `radius_m` the
  /// root mean square distance of the matched features from their centroid.
  void advance(const imu::NavState& before, const imu::NavState& now, const Matrix6d& covariance,
               double radius_m);

  /// The local map is begun anew at a pose with this covariance against the map of before.
  void begin_anew(const Matrix6d& covariance) { covariance_ += covariance; }

  /// Of T_odom_imu at the newest pose, order [dtheta (body), dt (odom)]; add it to that against the local
  /// map.
  const Matrix6d& covariance() const { return covariance_; }

 private:
  double share_;
  Matrix6d covariance_ = Matrix6d::Zero();
};

}  // namespace fdi_lio::odometry
