#include "fdi_lio/odometry/calibration_report.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>
#include <utility>

#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/mounting.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr double kUsualMounting = 5.0;  ///< error of the mounting in its standard deviations
constexpr double kLeastMountingSigma_deg = 0.05;
constexpr double kUsualTimeOffset = 2.0;  ///< in its standard deviations
constexpr double kLeastTimeOffsetSigma_s = 1e-3;
constexpr double kUsualGyroScale = 3.0;  ///< in its standard deviations
constexpr double kLeastGyroScaleSigma = 2e-3;
/// The time offset is reported when it has changed by no more than this share in so many scans.
constexpr double kSettledShare = 0.05;
constexpr int kSettledScans = 30;

}  // namespace

CalibrationReport::CalibrationReport(const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter) {}

void CalibrationReport::add(const imu::NavState& state, const imu::ImuStatistics& recent) {
  report_mounting(state);
  report_gyro_scale(state);
  if (imu::is_shaken(sensor_, recent)) report_vibration(recent);
  if (scans_++ % kSettledScans == 0) report_time_offset(state);
}

void CalibrationReport::report_mounting(const imu::NavState& state) {
  const double sigma_deg = std::max(sensor_.mounting_sigma_deg, kLeastMountingSigma_deg);
  if (state.mounting.norm() * 180.0 / M_PI <= kUsualMounting * sigma_deg) return;
  const Eigen::Quaterniond q =
      corrected_rotation(Eigen::Quaterniond(sensor_.T_imu_lidar().rotation()), state.mounting);
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "the rotation of sensor.T_imu_lidar seems to be wrong by "
       << state.mounting.norm() * 180.0 / M_PI << " deg (sensor.mounting_sigma " << sensor_.mounting_sigma_deg
       << "); scans and IMU fit with rotation: [" << std::setprecision(6) << q.x() << ", " << q.y() << ", "
       << q.z() << ", " << q.w() << "]";
  reporter_->report(Severity::kWarning, "mounting", text.str());
}

void CalibrationReport::report_gyro_scale(const imu::NavState& state) {
  int axis = 0;
  const double error = state.gyro_scale.diagonal().cwiseAbs().maxCoeff(&axis);
  if (error <= kUsualGyroScale * std::max(sensor_.gyro_scale_sigma, kLeastGyroScaleSigma)) return;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the gyro seems to read turns about its "
       << "xyz"[axis] << " axis " << 100.0 * error << " % too "
       << (state.gyro_scale(axis, axis) > 0.0 ? "large" : "small") << " (sensor.gyro_scale_sigma "
       << std::setprecision(3) << sensor_.gyro_scale_sigma
       << "); the estimate takes that into account. Calibrate the IMU, or say with sensor.gyro_scale_sigma "
          "that its scale is not known so well";
  reporter_->report(Severity::kWarning, "gyro_scale", text.str());
}

void CalibrationReport::report_time_offset(const imu::NavState& state) {
  const double offset_s = state.lidar_time_offset_s;
  const double change_s = offset_s - std::exchange(time_offset_then_s_, offset_s);
  const double sigma_s = std::max(sensor_.lidar_time_offset_sigma_s, kLeastTimeOffsetSigma_s);
  const bool is_usual = std::abs(offset_s) <= kUsualTimeOffset * sigma_s;
  if (is_usual || std::abs(change_s) > kSettledShare * std::abs(offset_s)) return;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the stamps of the scans seem to be "
       << 1e3 * std::abs(offset_s) << " ms too " << (offset_s > 0.0 ? "early" : "late")
       << " for the clock of the IMU; the estimate takes that into account. Set sensor.lidar_time_offset to "
       << std::setprecision(4) << sensor_.lidar_time_offset_s + offset_s
       << " so that it does from the first scan on";
  reporter_->report(Severity::kWarning, "time_offset", text.str());
}

void CalibrationReport::report_vibration(const imu::ImuStatistics& recent) {
  std::ostringstream text;
  text << std::setprecision(2) << "the readings of the IMU show white noise of " << recent.acceleration_noise
       << " m/s^2/sqrt(Hz) and " << recent.angular_velocity_noise
       << " rad/s/sqrt(Hz), more than sensor.accel_noise (" << sensor_.accel_noise
       << ") and sensor.gyro_noise (" << sensor_.gyro_noise
       << ") say: vibration? The estimate takes that into account; dampers or a filter in the IMU would help";
  reporter_->report(Severity::kWarning, "imu_vibration", text.str());
}

}  // namespace fdi_lio::odometry
