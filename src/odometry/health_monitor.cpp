#include "fdi_lio/odometry/health_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace fdi_lio::odometry {

namespace {

constexpr std::size_t kMinMatches = 30;
constexpr double kMinMatchShare = 0.1;
/// Or of the share that is usual, a mean over about so many scans.
constexpr double kMinUsualShare = 0.4;
constexpr double kUsualScans = 10.0;
constexpr double kUnusualShare = 0.92;  ///< of the usual one
constexpr double kWellKnown = 0.5;
constexpr int kLostScans = 50;
/// The innovation is averaged over about so many scans, each counting for so much at most: a single one may
/// follow a gap.
constexpr double kAveragedScans = 50.0;
constexpr double kMostInnovationSq = 2.5;
constexpr double kContradictionSq = 0.5;
/// A single one is sudden from so much on, and so many times the average.
constexpr double kSuddenSq = 0.1;
constexpr double kSudden = 10.0;
/// After a beginning biases and velocity find their values first.
constexpr int kSettlingScans = 30;
/// Beyond what consumer IMUs have.
constexpr double kMaxAccelBias = 1.0;  ///< [m/s^2]
constexpr double kMaxGyroBias = 0.1;   ///< [rad/s]

/// Of a scan, in the covariance of its prediction and what may misfit.
double innovation_sq(const HealthMonitor::Prediction& prediction, const imu::NavState& state) {
  const Vector6d innovation = difference(prediction.T_odom_imu, state.T_odom_imu());
  const Matrix6d covariance = prediction.covariance + HealthMonitor::misfit();
  return innovation.dot(covariance.ldlt().solve(innovation));
}

}  // namespace

std::size_t HealthMonitor::least_matches(std::size_t features) const {
  const double share = std::min(kMinMatchShare, kMinUsualShare * usual_share_.value_or(0.0));
  return std::max(kMinMatches, static_cast<std::size_t>(std::ceil(share * static_cast<double>(features))));
}

bool HealthMonitor::is_well_known() const { return usual_share_ && *usual_share_ >= kWellKnown; }

double HealthMonitor::least_usual_share() const {
  return is_well_known() ? kUnusualShare * *usual_share_ : 0.0;
}

void HealthMonitor::add_unmatched() {
  if (++unmatched_ != kLostScans) return;
  reporter_->report(
      Severity::kError, "lost",
      "lost: for " + std::to_string(kLostScans) +
          " scans nothing matched, and the pose is dead reckoning; begin at rest or slowly, check "
          "sensor.T_imu_lidar and the clocks, or call the service reset");
}

void HealthMonitor::add(const std::optional<Prediction>& prediction, const imu::NavState& state,
                        double matched_share) {
  unmatched_ = 0;
  if (!usual_share_) usual_share_ = matched_share;
  *usual_share_ += (matched_share - *usual_share_) / kUsualScans;
  if (state.imu_status != imu::ImuStatus::kInitialised) return;
  if (prediction && !prediction->is_shaken) check_innovation(*prediction, state);
  check_biases(state);
}

void HealthMonitor::restart() {
  unmatched_ = 0;
  usual_share_.reset();
  innovations_ = 0;
  mean_innovation_sq_ = 0.0;
}

double HealthMonitor::suddenness(const Prediction& prediction, const imu::NavState& state) const {
  if (prediction.is_shaken || innovations_ < kSettlingScans || !is_well_known()) return 0.0;
  return innovation_sq(prediction, state) / std::max(kSuddenSq, kSudden * mean_innovation_sq_);
}

void HealthMonitor::check_innovation(const Prediction& prediction, const imu::NavState& state) {
  ++innovations_;
  if (innovations_ <= kSettlingScans) return;
  const double innovation_sq = odometry::innovation_sq(prediction, state);
  mean_innovation_sq_ += (std::min(innovation_sq, kMostInnovationSq) - mean_innovation_sq_) / kAveragedScans;
  if (mean_innovation_sq_ < kContradictionSq) return;
  reporter_->report(Severity::kWarning, "imu_contradiction",
                    "scans and IMU contradict each other (mean squared innovation " +
                        std::to_string(mean_innovation_sq_) +
                        ", usual below 0.2): check the rotation of sensor.T_imu_lidar, the clocks "
                        "(sensor.lidar_time_offset) and the units of the IMU");
}

void HealthMonitor::check_biases(const imu::NavState& state) {
  const double accel = state.accel_bias.norm();
  const double gyro = state.gyro_bias.norm();
  if (accel <= kMaxAccelBias && gyro <= kMaxGyroBias) return;
  reporter_->report(Severity::kWarning, "imu_bias",
                    "the estimated biases of the IMU are implausible (accelerometer " +
                        std::to_string(accel) + " m/s^2, gyro " + std::to_string(gyro) +
                        " rad/s): the estimate may be lost; check sensor.T_imu_lidar, the units and "
                        "sensor.gravity");
}

}  // namespace fdi_lio::odometry
