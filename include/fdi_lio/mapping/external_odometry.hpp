#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/global_config.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// What wheels or a camera say (nav_msgs/Odometry). `child` is the frame that they follow.
struct ExternalPose {
  Stamp stamp = 0;
  Eigen::Isometry3d T_world_child = Eigen::Isometry3d::Identity();
  /// Variances of the twist in `child`, [angular, linear], (rad/s)^2 and (m/s)^2; zero: not stated.
  Vector6d twist_variance = Vector6d::Zero();
  /// Variances of the pose, [rotation, translation], rad^2 and m^2; only whether an axis is known at all is
  /// read from them, for they grow with the way in some drivers and are constant in others.
  Vector6d pose_variance = Vector6d::Zero();
};

/// Odometry from another source, as steps between keyframes. Keeps what later keyframes may need, 100 000
/// poses at most.
///
/// The covariance of a step of the way d with the turn a, in the axes of `child`, is
///   (sigma_m d + 5 mm)^2 along each axis, (sigma_deg_per_m d + 0.1 a + 0.1 deg)^2 about each,
/// plus the stated variance of the twist times the step's time squared. Axes whose stated variance of pose or
/// twist is 1000 and more are unknown, which is what drivers of planar odometry write for z, roll and pitch.
class ExternalOdometry {
 public:
  explicit ExternalOdometry(const ExternalOdometryConfig& config);

  /// Adds a pose. False, and it is not used, when its numbers are none, its quaternion has no length, or its
  /// stamp does not follow the one before.
  bool add(const ExternalPose& pose);

  /// Whether everything up to `stamp` has come.
  bool reaches(Stamp stamp) const { return !poses_.empty() && poses_.back().stamp >= stamp; }

  /// The motion of the IMU from one stamp to a later one, with the nodes left 0. Nothing when there is a gap
  /// of more than `max_gap` about one of them.
  std::optional<ExternalStep> step(Stamp from, Stamp to) const;

  /// Forgets what is not needed for steps that begin at `stamp` or later.
  void forget_before(Stamp stamp);

  std::size_t size() const { return poses_.size(); }

 private:
  std::optional<Eigen::Isometry3d> pose_at(Stamp stamp) const;
  Matrix6d covariance_of(const Eigen::Isometry3d& T_step, double duration_s,
                         const ExternalPose& stated) const;

  ExternalOdometryConfig config_;
  Eigen::Isometry3d T_imu_child_;
  std::deque<ExternalPose> poses_;
};

}  // namespace fdi_lio::mapping
