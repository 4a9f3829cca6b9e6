#pragma once

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::mapping {

/// Says what the smoother found of the calibration of lidar against IMU where it is far from what the
/// parameters state, and which values would fit: `mounting`, `time_offset`.
class CalibrationReport {
 public:
  CalibrationReport(const SensorConfig& sensor, Reporter* reporter);

  /// The estimate of each scan in turn.
  void add(const imu::NavState& state);

 private:
  void report_mounting(const imu::NavState& state);
  void report_time_offset(const imu::NavState& state);

  SensorConfig sensor_;
  Reporter* reporter_;
  int scans_ = 0;
  double time_offset_then_s_ = 0.0;  ///< when it was looked at last
};

}  // namespace fdi_lio::mapping
