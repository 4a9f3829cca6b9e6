#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"

namespace fdi_lio::scan {

/// Something about the data that the user should know before SLAM is blamed for it.
struct Finding {
  Severity severity = Severity::kWarning;  ///< an error makes a useful result impossible
  std::string key;                         ///< for machines: does not change with the values
  std::string text;  ///< what was measured, what was expected, which parameter to change
};

/// Gives findings to `reporter`, under their key after `check_`; true when one is an error.
bool report_findings(const std::vector<Finding>& findings, Reporter* reporter);

/// Looks at the first seconds of a recording and compares them with the configuration: units, rates, clocks,
/// the extrinsic against gravity, the layout of the clouds. Feed it in the order of reception, then ask.
/// Where stamps jump for good (StampGuard) it stops to look.
class DataCheck {
 public:
  explicit DataCheck(const Config& config);

  /// One reading as the driver sent it, in its own unit.
  void add_imu(const imu::ImuSample& sample);

  /// One scan as the reader made it, not deskewed, lidar frame.
  void add_scan(const Scan& scan);

  /// Replaces the extrinsic of the configuration, for one that is known only later (tf).
  void set_extrinsic(const Eigen::Isometry3d& T_imu_lidar);

  /// Everything found so far, errors first. Empty: nothing to complain about.
  std::vector<Finding> findings() const;

 private:
  /// What is kept of a scan.
  struct ScanSummary {
    Stamp stamp = 0;
    double duration_s = 0.0;
    bool has_time = false;
    bool time_from_azimuth = false;
    std::vector<Eigen::Vector3f> points;  ///< a few thousand of them
  };
  using Findings = std::vector<Finding>;

  void check_readings(Findings* findings) const;
  void check_limits(Findings* findings) const;
  void check_imu_rate(Findings* findings) const;
  void check_acceleration(Findings* findings) const;
  void check_gyro_unit(Findings* findings) const;
  void check_scan_period(Findings* findings) const;
  void check_clocks(Findings* findings) const;
  void check_point_times(Findings* findings) const;
  void check_rings(Findings* findings) const;
  void check_extrinsic(Findings* findings) const;

  Config config_;
  Reporter imu_reporter_;     ///< what the buffer says about single readings
  imu::ImuBuffer imu_;        ///< usable readings in order, m/s^2 by the unit of the configuration
  std::size_t readings_ = 0;  ///< all that came
  std::size_t non_finite_ = 0;
  std::vector<imu::ImuSample> impossible_;  ///< beyond what a sensor measures, in the driver's unit
  std::size_t unordered_ = 0;
  StampGuard imu_guard_;
  double scale_ = 1.0;  ///< from the driver's unit of acceleration to that of the buffer
  std::vector<ScanSummary> scans_;
  std::size_t unordered_scans_ = 0;
  StampGuard scan_guard_;
  bool has_jumped_ = false;  ///< what comes after a jump of the stamps is another recording
  std::set<std::uint16_t> rings_;
};

}  // namespace fdi_lio::scan
