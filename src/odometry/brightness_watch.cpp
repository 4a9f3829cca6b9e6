#include "fdi_lio/odometry/brightness_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/LU>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/odometry/brightness_motion.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr std::size_t kScans = 16;
/// Standard deviations of what is known at first, at best, and above which the velocity is doubtful.
constexpr double kFirstVelocity = 0.05;    ///< [m/s]
constexpr double kDoubtfulVelocity = 0.1;  ///< [m/s]
/// What gravity along the way, the accelerometer's bias and its errors in motion leave open, and how fast
/// that changes.
constexpr double kAcceleration = 0.1;       ///< [m/s^2]
constexpr double kAccelerationWalk = 0.03;  ///< [m/s^2/sqrt(s)]
/// For so long the positions of scans tell a velocity [s].
constexpr double kMemory = 1.6;
/// Slower, what travels with the sensor is among the velocities that are compared, and would speak for rest.
constexpr double kLeastSpeed = 6.0;
constexpr double kLeastInformation = 1e-6;  ///< about the position [1/m^2]: keeps its inverse regular
/// An offset whose square is more than so many times what was expected refutes the covariance.
constexpr double kRefuting = 4.0;

/// Of the position along `direction`, whatever it is across [1/m^2].
double information_along(const Eigen::Vector3d& direction, const Eigen::Matrix3d& information) {
  const Eigen::Matrix3d some = information + kLeastInformation * Eigen::Matrix3d::Identity();
  return 1.0 / direction.dot(some.inverse() * direction);
}

}  // namespace

void BrightnessWatch::forget_scans() {
  scans_.clear();
  states_.clear();
}

void BrightnessWatch::reset(double velocity_sigma, double gravity_sigma) {
  const double velocity = std::max(velocity_sigma, kFirstVelocity);
  const double acceleration = std::max(gravity_sigma, kAcceleration);
  covariance_ = Eigen::Vector2d(velocity * velocity, acceleration * acceleration).asDiagonal();
  newest_.reset();
  forget_scans();
}

/// Positions with the information I a scan, spread over T, tell the velocity with the sum of I times T^2
/// / 12.
void BrightnessWatch::advance(const imu::NavState& state, const Eigen::Matrix3d& trusted_information) {
  if (newest_) {
    const double dt = seconds_between(*newest_, state.stamp);
    Eigen::Matrix2d F = Eigen::Matrix2d::Identity();
    F(0, 1) = dt;
    covariance_ = F * covariance_ * F.transpose();
    covariance_(1, 1) += kAccelerationWalk * kAccelerationWalk * dt;
  }
  newest_ = state.stamp;
  if (state.v_odom.isZero(0.0)) return;
  const double information =
      information_along(state.v_odom.normalized(), trusted_information) * kMemory * kMemory / 12.0;
  const Eigen::Vector2d column = covariance_.col(0);
  covariance_ -= column * column.transpose() * information / (1.0 + information * column(0));
}

BrightnessWatch::Correction BrightnessWatch::ask() {
  const imu::NavState& first = states_.front();
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    const double time_s = seconds_between(first.stamp, states_[k].stamp);
    scans_[k].gained_mps = states_[k].v_odom - first.v_odom;
    scans_[k].gained_m = states_[k].t_odom_imu - first.t_odom_imu - time_s * first.v_odom;
  }
  const Eigen::Vector3d ahead = first.v_odom.normalized();
  const BrightnessOffset offset = find_brightness_offset(scans_, first.v_odom, ahead);
  const double square = offset.mean_mps * offset.mean_mps;
  if (square > kRefuting * (covariance_(0, 0) + offset.variance))
    covariance_ *= (square - offset.variance) / covariance_(0, 0);
  const Eigen::Vector2d column = covariance_.col(0);
  const Eigen::Vector2d gain = column / (column(0) + offset.variance);
  covariance_ -= gain * column.transpose();
  return {gain(0) * offset.mean_mps * ahead, gain(1) * offset.mean_mps * ahead};
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::add(const FeatureSet& features,
                                                                const Eigen::Vector3d& v_deskew,
                                                                const imu::NavState& state,
                                                                const Eigen::Matrix3d& trusted_information) {
  advance(state, trusted_information);
  if (covariance_(0, 0) < kDoubtfulVelocity * kDoubtfulVelocity || state.v_odom.norm() < kLeastSpeed) {
    forget_scans();
    return std::nullopt;
  }
  scans_.push_back(bright_scan(features, state.q_odom_imu * R_imu_lidar_, v_deskew));
  states_.push_back(state);
  if (scans_.size() < kScans) return std::nullopt;
  const Correction correction = ask();
  forget_scans();
  return correction;
}

}  // namespace fdi_lio::odometry
