#include "fdi_lio/odometry/brightness_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

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
/// Surfaces that hold the velocity to less are beyond doubt [m/s].
constexpr double kSureVelocity = 0.03;
/// An offset whose square is more than so many times what was expected refutes the covariance; against
/// surfaces, which mostly are right, a second one to the same side is needed, too.
constexpr double kRefuting = 4.0;
constexpr double kRefutingSurfaces = 9.0;
/// Questions in a row without a pause, and what the pauses grow by [scans].
constexpr std::size_t kFirstTests = 4;
constexpr std::size_t kPauseStep = 16;
constexpr std::size_t kMostPause = 64;
constexpr double kDistrust = 10.0;  ///< in what has confirmed a wrong velocity [s]

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

void BrightnessWatch::Window::clear() {
  scans.clear();
  states.clear();
}

BrightnessOffset BrightnessWatch::Window::offset() {
  const imu::NavState& first = states.front();
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const double time_s = seconds_between(first.stamp, states[k].stamp);
    scans[k].gained_mps = states[k].v_odom - first.v_odom;
    scans[k].gained_m = states[k].t_odom_imu - first.t_odom_imu - time_s * first.v_odom;
  }
  return find_brightness_offset(scans, first.v_odom, first.v_odom.normalized());
}

void BrightnessWatch::Pace::agree() {
  if (++agreeing >= kFirstTests) pause = std::min(pause + kPauseStep, kMostPause);
}

void BrightnessWatch::reset(double velocity_sigma, double gravity_sigma) {
  const double velocity = std::max(velocity_sigma, kFirstVelocity);
  const double acceleration = std::max(gravity_sigma, kAcceleration);
  covariance_ = Eigen::Vector3d(0.0, velocity * velocity, acceleration * acceleration).asDiagonal();
  newest_.reset();
  pace_ = surfaces_pace_ = Pace();
  suspected_mps_ = 0.0;
  distrust_s_ = 0.0;
  window_.clear();
  surfaces_window_.clear();
}

bool BrightnessWatch::is_doubtful() const {
  return covariance_(1, 1) >= kDoubtfulVelocity * kDoubtfulVelocity;
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
  surfaces_variance_ = velocity_variance(ahead_, information.surfaces);
  if (distrust_s_ <= 0.0) {
    measure(velocity_variance(ahead_, information.all));
  } else if (!distrusts_surfaces_) {
    measure(surfaces_variance_);
  }
}

bool BrightnessWatch::is_contradicted(const BrightnessOffset& offset, double times) const {
  return offset.mean_mps * offset.mean_mps > times * (covariance_(1, 1) + offset.variance);
}

/// P is as large as the offset tells, which nothing but brightness makes smaller for a while.
void BrightnessWatch::distrust(const BrightnessOffset& offset) {
  distrust_s_ = kDistrust;
  const double square = offset.mean_mps * offset.mean_mps;
  const double factor = (square - offset.variance) / covariance_(1, 1);
  position_covariance_ += (factor - 1.0) * covariance_(0, 0) * ahead_ * ahead_.transpose();
  covariance_ *= factor;
}

BrightnessWatch::Correction BrightnessWatch::correct(const BrightnessOffset& offset,
                                                     const Eigen::Vector3d& ahead) {
  const Eigen::Vector2d gain = measure(offset.variance);
  return {gain(0) * offset.mean_mps * ahead, gain(1) * offset.mean_mps * ahead};
}

/// No correction of a velocity that is neither doubtful nor refuted.
std::optional<BrightnessWatch::Correction> BrightnessWatch::ask_velocity() {
  const Eigen::Vector3d ahead = window_.states.front().v_odom.normalized();
  const BrightnessOffset offset = window_.offset();
  window_.clear();
  pace_.scans = 0;
  if (is_contradicted(offset, kRefuting)) {
    pace_ = Pace();
    distrusts_surfaces_ = false;
    distrust(offset);
  } else if (!is_doubtful()) {
    pace_.agree();
    return std::nullopt;
  }
  return correct(offset, ahead);
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::test_surfaces(const BrightScan& scan,
                                                                          const imu::NavState& state) {
  surfaces_window_.scans.push_back(scan);
  surfaces_window_.states.push_back(state);
  if (surfaces_window_.scans.size() < kScans) return std::nullopt;
  const Eigen::Vector3d ahead = surfaces_window_.states.front().v_odom.normalized();
  const BrightnessOffset offset = surfaces_window_.offset();
  surfaces_window_.clear();
  surfaces_pace_.scans = 0;
  const double before_mps = std::exchange(suspected_mps_, 0.0);
  if (!is_contradicted(offset, kRefutingSurfaces)) {
    surfaces_pace_.agree();
    return std::nullopt;
  }
  surfaces_pace_ = Pace();
  if (before_mps * offset.mean_mps <= 0.0) {
    suspected_mps_ = offset.mean_mps;
    return std::nullopt;
  }
  distrusts_surfaces_ = true;
  distrust(offset);
  return correct(offset, ahead);
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::add(const FeatureSet& features,
                                                                const Eigen::Vector3d& v_deskew,
                                                                const imu::NavState& state,
                                                                const TrustedInformation& information) {
  advance(state, information);
  const bool is_fast = state.v_odom.norm() >= kLeastSpeed;
  const bool by_textures = surfaces_variance_ >= kDoubtfulVelocity * kDoubtfulVelocity;
  const bool is_asked = is_fast && (is_doubtful() || (pace_.is_due() && by_textures));
  const bool is_hardly_held =
      is_fast && !is_doubtful() && surfaces_variance_ >= kSureVelocity * kSureVelocity;
  const bool is_tested = is_hardly_held && surfaces_pace_.is_due();
  if (!is_asked) window_.clear();
  if (!is_tested) surfaces_window_.clear();
  if (!is_asked && !is_tested) return std::nullopt;
  BrightScan scan = bright_scan(features, state.q_odom_imu * R_imu_lidar_, v_deskew);
  std::optional<Correction> correction;
  if (is_tested) correction = test_surfaces(scan, state);
  if (!is_asked) return correction;
  window_.scans.push_back(std::move(scan));
  window_.states.push_back(state);
  if (correction || window_.scans.size() < kScans) return correction;
  return ask_velocity();
}

}  // namespace fdi_lio::odometry
