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
/// Tests of a velocity that textures alone hold follow each other without a pause until so many in a row have
/// found nothing, then with pauses that grow [scans].
constexpr std::size_t kFirstTests = 4;
constexpr std::size_t kPauseStep = 16;
constexpr std::size_t kMostPause = 64;
constexpr double kDistrust = 10.0;  ///< in textures that have confirmed a wrong velocity [s]

/// Of the position along `direction`, whatever it is across [1/m^2].
double information_along(const Eigen::Vector3d& direction, const Eigen::Matrix3d& information) {
  const Eigen::Matrix3d some = information + kLeastInformation * Eigen::Matrix3d::Identity();
  return 1.0 / direction.dot(some.inverse() * direction);
}

/// Positions with the information I a scan, spread over T, tell the velocity with the sum of I times T^2
/// / 12.
double velocity_variance(const Eigen::Vector3d& direction, const Eigen::Matrix3d& information) {
  return 12.0 / (information_along(direction, information) * kMemory * kMemory);
}

}  // namespace

void BrightnessWatch::forget_scans() {
  scans_.clear();
  states_.clear();
}

void BrightnessWatch::reset(double velocity_sigma, double gravity_sigma) {
  const double velocity = std::max(velocity_sigma, kFirstVelocity);
  const double acceleration = std::max(gravity_sigma, kAcceleration);
  covariance_ = Eigen::Vector3d(0.0, velocity * velocity, acceleration * acceleration).asDiagonal();
  newest_.reset();
  agreeing_tests_ = 0;
  pause_ = 0;
  scans_since_test_ = 0;
  distrust_s_ = 0.0;
  forget_scans();
}

bool BrightnessWatch::is_doubtful() const {
  return covariance_(1, 1) >= kDoubtfulVelocity * kDoubtfulVelocity;
}

/// Textures alone hold the velocity, and brightness was not asked for a while.
bool BrightnessWatch::is_to_be_tested(const TrustedInformation& information) {
  if (scans_since_test_++ < pause_) return false;
  return velocity_variance(ahead_, information.surfaces) >= kDoubtfulVelocity * kDoubtfulVelocity;
}

/// What measures dv with this variance takes from P, where dp stays uncorrected. Returns the gains for dv
/// and da.
Eigen::Vector2d BrightnessWatch::measure(double variance) {
  const Eigen::Vector2d gain = covariance_.col(1).tail<2>() / (covariance_(1, 1) + variance);
  Eigen::Matrix3d left = Eigen::Matrix3d::Identity();
  left.col(1).tail<2>() -= gain;
  covariance_ = left * covariance_ * left.transpose();
  covariance_.bottomRightCorner<2, 2>() += variance * gain * gain.transpose();
  return gain;
}

void BrightnessWatch::advance(const imu::NavState& state, const TrustedInformation& information) {
  if (newest_) {
    const double dt = seconds_between(*newest_, state.stamp);
    const double before = covariance_(0, 0);
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    F(0, 1) = F(1, 2) = dt;
    covariance_ = F * covariance_ * F.transpose();
    covariance_(2, 2) += kAccelerationWalk * kAccelerationWalk * dt;
    position_covariance_ += (covariance_(0, 0) - before) * ahead_ * ahead_.transpose();
    distrust_s_ -= dt;
  }
  newest_ = state.stamp;
  if (state.v_odom.isZero(0.0)) return;
  ahead_ = state.v_odom.normalized();
  measure(velocity_variance(ahead_, distrust_s_ > 0.0 ? information.surfaces : information.all));
}

/// No correction of a velocity that is neither doubtful nor refuted.
std::optional<BrightnessWatch::Correction> BrightnessWatch::ask() {
  const imu::NavState& first = states_.front();
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    const double time_s = seconds_between(first.stamp, states_[k].stamp);
    scans_[k].gained_mps = states_[k].v_odom - first.v_odom;
    scans_[k].gained_m = states_[k].t_odom_imu - first.t_odom_imu - time_s * first.v_odom;
  }
  const Eigen::Vector3d ahead = first.v_odom.normalized();
  const BrightnessOffset offset = find_brightness_offset(scans_, first.v_odom, ahead);
  const double square = offset.mean_mps * offset.mean_mps;
  if (square > kRefuting * (covariance_(1, 1) + offset.variance)) {
    distrust_s_ = kDistrust;
    agreeing_tests_ = 0;
    pause_ = 0;
    const double factor = (square - offset.variance) / covariance_(1, 1);
    position_covariance_ += (factor - 1.0) * covariance_(0, 0) * ahead * ahead.transpose();
    covariance_ *= factor;
  } else if (!is_doubtful()) {
    if (++agreeing_tests_ >= kFirstTests) pause_ = std::min(pause_ + kPauseStep, kMostPause);
    return std::nullopt;
  }
  const Eigen::Vector2d gain = measure(offset.variance);
  return Correction{gain(0) * offset.mean_mps * ahead, gain(1) * offset.mean_mps * ahead};
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::add(const FeatureSet& features,
                                                                const Eigen::Vector3d& v_deskew,
                                                                const imu::NavState& state,
                                                                const TrustedInformation& information) {
  advance(state, information);
  if (state.v_odom.norm() < kLeastSpeed || !(is_doubtful() || is_to_be_tested(information))) {
    forget_scans();
    return std::nullopt;
  }
  scans_.push_back(bright_scan(features, state.q_odom_imu * R_imu_lidar_, v_deskew));
  states_.push_back(state);
  if (scans_.size() < kScans) return std::nullopt;
  const std::optional<Correction> correction = ask();
  scans_since_test_ = 0;
  forget_scans();
  return correction;
}

}  // namespace fdi_lio::odometry
