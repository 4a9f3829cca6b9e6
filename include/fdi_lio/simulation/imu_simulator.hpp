#pragma once

#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

struct ImuReading {
  double time_s = 0.0;                                              ///< since the start of the recording
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();                   ///< rad/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();                  ///< m/s^2, +g upwards at rest
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< meaningful for 9 axes only
  Eigen::Vector3d true_gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d true_accel_bias = Eigen::Vector3d::Zero();
};

/// What an IMU reads of what is true, apart from bias and noise: scales on the diagonal, what the axes lean
/// towards each other beside it.
struct ImuAxes {
  Eigen::Matrix3d gyro = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d accel = Eigen::Matrix3d::Identity();
};

/// Reads the analytic derivatives of a trajectory like an IMU: scale and axes that are a little wrong, bias
/// with random walk, white noise, gravity.
class ImuSimulator {
 public:
  /// Keeps a reference to `trajectory`.
  ImuSimulator(const Trajectory& trajectory, const ImuSettings& settings,
               const ImperfectionSettings& imperfections, std::uint64_t seed);

  /// The next reading; the first is at t = 0.
  ImuReading next();

  const ImuAxes& axes() const { return axes_; }

 private:
  const Trajectory& trajectory_;
  ImuSettings settings_;
  std::uint64_t seed_;
  std::int64_t count_ = 0;
  Eigen::Vector3d gyro_bias_;
  Eigen::Vector3d accel_bias_;
  ImuAxes axes_;
};

}  // namespace fdi_lio::simulation
