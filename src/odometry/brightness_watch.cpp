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
/// Answers in a row without a pause, and what the pauses grow by [scans].
constexpr std::size_t kFirstAnswers = 4;
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

void BrightnessWatch::Inquiry::forget_scans() {
  scans_.clear();
  states_.clear();
}

void BrightnessWatch::Inquiry::note_agreement() {
  if (++agreeing_ >= kFirstAnswers) pause_ = std::min(pause_ + kPauseStep, kMostPause);
}

/// The answer to a question that the scan completes.
std::optional<BrightnessWatch::Inquiry::Answer> BrightnessWatch::Inquiry::add(const BrightScan& scan,
                                                                              const imu::NavState& state) {
  scans_.push_back(scan);
  states_.push_back(state);
  if (scans_.size() < kScans) return std::nullopt;
  const imu::NavState& first = states_.front();
  for (std::size_t k = 0; k < scans_.size(); ++k) {
    const double time_s = seconds_between(first.stamp, states_[k].stamp);
    scans_[k].gained_mps = states_[k].v_odom - first.v_odom;
    scans_[k].gained_m = states_[k].t_odom_imu - first.t_odom_imu - time_s * first.v_odom;
  }
  const Eigen::Vector3d ahead = first.v_odom.normalized();
  const Answer answer{find_brightness_offset(scans_, first.v_odom, ahead), ahead};
  since_last_ = 0;
  forget_scans();
  return answer;
}

void BrightnessWatch::reset(double velocity_sigma, double gravity_sigma) {
  const double velocity = std::max(velocity_sigma, kFirstVelocity);
  const double acceleration = std::max(gravity_sigma, kAcceleration);
  covariance_ = Eigen::Vector3d(0.0, velocity * velocity, acceleration * acceleration).asDiagonal();
  newest_.reset();
  of_velocity_ = of_surfaces_ = Inquiry();
  suspected_mps_ = 0.0;
  distrust_s_ = 0.0;
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

/// The answer is too far from the estimate for what both may be off by.
bool BrightnessWatch::contradicts(const BrightnessOffset& offset) const {
  return offset.mean_mps * offset.mean_mps > kRefuting * (covariance_(1, 1) + offset.variance);
}

/// P is as large as the answer tells, and for a while what has made it small counts for nothing.
void BrightnessWatch::distrust(const Inquiry::Answer& answer, bool surfaces) {
  distrust_s_ = kDistrust;
  distrusts_surfaces_ = surfaces;
  const double square = answer.offset.mean_mps * answer.offset.mean_mps;
  const double factor = (square - answer.offset.variance) / covariance_(1, 1);
  position_covariance_ += (factor - 1.0) * covariance_(0, 0) * answer.ahead * answer.ahead.transpose();
  covariance_ *= factor;
}

BrightnessWatch::Correction BrightnessWatch::correct(const Inquiry::Answer& answer) {
  const Eigen::Vector2d gain = measure(answer.offset.variance);
  of_velocity_.forget_scans();
  of_surfaces_.forget_scans();
  return {gain(0) * answer.offset.mean_mps * answer.ahead, gain(1) * answer.offset.mean_mps * answer.ahead};
}

/// No correction of a velocity that is neither doubtful nor refuted.
std::optional<BrightnessWatch::Correction> BrightnessWatch::review_velocity(const Inquiry::Answer& answer) {
  if (contradicts(answer.offset)) {
    of_velocity_.note_contradiction();
    distrust(answer, false);
  } else if (!is_doubtful()) {
    of_velocity_.note_agreement();
    return std::nullopt;
  }
  return correct(answer);
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::review_surfaces(const Inquiry::Answer& answer) {
  const double before_mps = std::exchange(suspected_mps_, 0.0);
  if (!contradicts(answer.offset)) {
    of_surfaces_.note_agreement();
    return std::nullopt;
  }
  of_surfaces_.note_contradiction();
  if (before_mps * answer.offset.mean_mps <= 0.0) {
    suspected_mps_ = answer.offset.mean_mps;
    return std::nullopt;
  }
  distrust(answer, true);
  return correct(answer);
}

std::optional<BrightnessWatch::Correction> BrightnessWatch::add(const FeatureSet& features,
                                                                const Eigen::Vector3d& v_deskew,
                                                                const imu::NavState& state,
                                                                const TrustedInformation& information) {
  advance(state, information);
  const bool is_fast = state.v_odom.norm() >= kLeastSpeed;
  const bool by_textures = surfaces_variance_ >= kDoubtfulVelocity * kDoubtfulVelocity;
  const bool by_weak_surfaces = !is_doubtful() && surfaces_variance_ >= kSureVelocity * kSureVelocity;
  const bool asks_velocity = is_fast && (is_doubtful() || (of_velocity_.is_due() && by_textures));
  const bool asks_surfaces = is_fast && by_weak_surfaces && of_surfaces_.is_due();
  if (!asks_velocity) of_velocity_.forget_scans();
  if (!asks_surfaces) of_surfaces_.forget_scans();
  if (!asks_velocity && !asks_surfaces) return std::nullopt;
  const BrightScan scan = bright_scan(features, state.q_odom_imu * R_imu_lidar_, v_deskew);
  std::optional<Correction> correction;
  if (asks_velocity) {
    if (const auto answer = of_velocity_.add(scan, state)) correction = review_velocity(*answer);
  }
  if (asks_surfaces && !correction) {
    if (const auto answer = of_surfaces_.add(scan, state)) correction = review_surfaces(*answer);
  }
  return correction;
}

}  // namespace fdi_lio::odometry
