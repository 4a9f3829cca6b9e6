#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fdi_lio::simulation {

/// Motion of the IMU at one instant.
struct MotionState {
  Eigen::Isometry3d T_map_imu = Eigen::Isometry3d::Identity();
  Eigen::Vector3d v_map = Eigen::Vector3d::Zero();  ///< velocity of the IMU, m/s
  Eigen::Vector3d a_map = Eigen::Vector3d::Zero();  ///< acceleration without gravity, m/s^2
  Eigen::Vector3d w_imu = Eigen::Vector3d::Zero();  ///< angular velocity in the IMU frame, rad/s
};

/// x y z (metres), roll pitch yaw (radians, continuous); R_map_imu = Rz(yaw) Ry(pitch) Rx(roll).
using PoseVector = Eigen::Matrix<double, 6, 1>;

/// Smooth motion: a uniform quintic B-spline over position and Euler angles, four times continuously
/// differentiable, so that the IMU readings are exact derivatives. The poses are control points: the curve
/// smooths over about 0.7 knot periods instead of passing through them. |pitch| must stay below 80 degrees.
class Trajectory {
 public:
  /// `poses` are spaced by `knot_period_s`; the first belongs to t = 0. Beyond both ends it goes on
  /// with the velocity that it has there, so that a recording can begin at speed without a jolt.
  Trajectory(std::vector<PoseVector> poses, double knot_period_s);

  MotionState evaluate(double t) const;

  /// Only the pose; cheaper.
  Eigen::Isometry3d pose(double t) const;

  double duration_s() const { return knot_period_s_ * static_cast<double>(poses_.size() - 1); }

  /// Length of the way driven in [0, duration_s], metres (sampled at the knots).
  double length_m() const;

 private:
  PoseVector control_point(std::int64_t index) const;
  PoseVector blend(double t, int derivative) const;

  std::vector<PoseVector> poses_;
  double knot_period_s_;
};

/// Another drive along the way of `drive`: begins at rest where that is after `begin_s`, and goes on as that
/// does, or back, with the vehicle turned.
Trajectory revisit(const Trajectory& drive, double begin_s, bool reversed, double duration_s);

/// Rotation of x-y-z-Euler angles as in PoseVector.
Eigen::Matrix3d rotation_from_angles(double roll, double pitch, double yaw);

}  // namespace fdi_lio::simulation
