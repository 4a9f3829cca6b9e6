#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/gravity_estimate.hpp"

namespace fdi_lio::odometry {

/// What one scan gave.
struct EstimateResult {
  imu::NavState state;  ///< at the scan's reference stamp
  /// Of T_odom_imu against the origin of odom, drift included, order [dtheta (body), dt (odom)].
  Matrix6d covariance = Matrix6d::Identity();
  /// The same against the local map alone: what this scan's registration and the IMU leave open.
  Matrix6d map_covariance = Matrix6d::Identity();
  Eigen::Matrix3d velocity_covariance = Eigen::Matrix3d::Identity();  ///< in odom axes
  degeneracy::OptimisationStatus status;
  /// Information along each of the status's axes, and what the noise alone would give [1/m^2].
  Eigen::Matrix<double, 6, 1> axis_information = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> axis_noise = Eigen::Matrix<double, 6, 1>::Zero();
  bool is_keyframe = false;
  std::optional<GravityEstimate> gravity;  ///< at keyframes, once the IMU is initialised
  bool is_healthy = true;                  ///< false: no match was possible, the pose is a prediction
  std::size_t matched_planes = 0;
  std::size_t matched_edges = 0;
  std::size_t matched_textures = 0;
  /// States of earlier scans that were wrong: a start turned out to be in motion, or the first scans came
  /// before the first reading. In time order, mostly empty.
  std::vector<imu::NavState> revised;

  /// Of the surfaces that were matched, about the position (IMU axes, [1/m^2]).
  Eigen::Matrix3d position_information() const {
    const Eigen::Matrix<double, 3, 6> axes = status.axes.bottomRows<3>();
    return axes * axis_information.asDiagonal() * axes.transpose();
  }
};

}  // namespace fdi_lio::odometry
