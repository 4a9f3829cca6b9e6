#pragma once

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// Says what was found of the sensors where it is far from what the parameters state, and which values would
/// fit: calibration of lidar against IMU by the smoother (`mounting`, `gyro_scale`, `time_offset`), noise of
/// the IMU by its readings (`imu_vibration`).
class CalibrationReport {
 public:
  CalibrationReport(const SensorConfig& sensor, Reporter* reporter);

  /// The estimate of each scan in turn, and what the readings before it show.
  void add(const imu::NavState& state, const imu::ImuStatistics& recent);

 private:
  void report_mounting(const imu::NavState& state);
  void report_gyro_scale(const imu::NavState& state);
  void report_time_offset(const imu::NavState& state);
  void report_vibration(const imu::ImuStatistics& recent);

  SensorConfig sensor_;
  Reporter* reporter_;
  int scans_ = 0;
  double time_offset_then_s_ = 0.0;  ///< when it was looked at last
};

}  // namespace fdi_lio::odometry
