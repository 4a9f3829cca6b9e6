#include "fdi_lio/mapping/brightness_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Eigenvalues>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/brightness_motion.hpp"

namespace fdi_lio::mapping {

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
/// An offset whose square is more than so many times what was expected refutes the covariance.
constexpr double kRefuting = 4.0;

}  // namespace

void BrightnessWatch::forget_scans() {
  scans_.clear();
  states_.clear();
  information_.setZero();
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
void BrightnessWatch::advance(Stamp stamp, const Eigen::Matrix3d& trusted_information) {
  if (newest_) {
    const double dt = seconds_between(*newest_, stamp);
    Eigen::Matrix2d F = Eigen::Matrix2d::Identity();
    F(0, 1) = dt;
    covariance_ = F * covariance_ * F.transpose();
    covariance_(1, 1) += kAccelerationWalk * kAccelerationWalk * dt;
  }
  newest_ = stamp;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> known(trusted_information, Eigen::EigenvaluesOnly);
  const double information = std::max(0.0, known.eigenvalues()(0)) * kMemory * kMemory / 12.0;
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
  const Eigen::Vector3d weakest =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information_).eigenvectors().col(0);
  const BrightnessOffset offset = find_brightness_offset(scans_, first.v_odom, weakest);
  const double square = offset.mean_mps * offset.mean_mps;
  if (square > kRefuting * (covariance_(0, 0) + offset.variance))
    covariance_ *= (square - offset.variance) / covariance_(0, 0);
  const Eigen::Vector2d column = covariance_.col(0);
  const Eigen::Vector2d gain = column / (column(0) + offset.variance);
  covariance_ -= gain * column.transpose();
  return {gain(0) * offset.mean_mps * weakest, gain(1) * offset.mean_mps * weakest};
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::add(const FeatureSet& features,
                                                                const Eigen::Vector3d& v_deskew,
                                                                const imu::NavState& state,
                                                                const Eigen::Matrix3d& trusted_information) {
  advance(state.stamp, trusted_information);
  if (covariance_(0, 0) < kDoubtfulVelocity * kDoubtfulVelocity || state.v_odom.norm() < kLeastSpeed) {
    forget_scans();
    return std::nullopt;
  }
  scans_.push_back(bright_scan(features, state.q_odom_imu * R_imu_lidar_, v_deskew));
  states_.push_back(state);
  information_ += trusted_information;
  if (scans_.size() < kScans) return std::nullopt;
  const Correction correction = ask();
  forget_scans();
  return correction;
}

}  // namespace fdi_lio::mapping
