#include "fdi_lio/odometry/shock_guard.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace fdi_lio::odometry {

namespace {

constexpr double kDoubtfulStep = 0.02;  ///< of a scan's prediction [m]

}  // namespace

double ShockGuard::add(double change_mps, double duration_s) {
  if (scans_ > 0) --scans_;
  if (scans_ == 0) {
    doubtful_turn_.setZero();
    doubtful_velocity_mps_ = 0.0;
  }
  const double acceleration = change_mps / std::max(1e-6, duration_s);
  const double doubtful_mps =
      change_mps * std::clamp(2.0 * acceleration / shock_acceleration_mps2_ - 1.0, 0.0, 1.0);
  if (doubtful_mps * duration_s <= kDoubtfulStep) return std::max(doubtful_mps, doubtful_velocity_mps_);
  scans_ = kScans;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "a shock: by the IMU the velocity changed by " << change_mps
       << " m/s in " << std::setprecision(2) << duration_s
       << " s, which may be false (sensor.shock_acceleration): the scans decide";
  reporter_->report(Severity::kInfo, "imu_shock", text.str());
  return std::max(doubtful_mps, doubtful_velocity_mps_);
}

void ShockGuard::note_missed_turn(const Eigen::Vector3d& turn) {
  scans_ = kScans;
  doubtful_turn_ = turn;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the scans show a turn of " << turn.norm() * 180.0 / M_PI
       << " degrees more than the gyro: a blow, or more than its range";
  reporter_->report(Severity::kWarning, "gyro_missed", text.str());
}

void ShockGuard::note_missed_step(double step_m, double doubtful_mps) {
  scans_ = kScans;
  doubtful_velocity_mps_ = doubtful_mps;
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "the scans show a step of " << step_m
       << " m more than the accelerometer: a blow, or more than its range";
  reporter_->report(Severity::kWarning, "accel_missed", text.str());
}

}  // namespace fdi_lio::odometry
