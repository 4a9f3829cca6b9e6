#include "fdi_lio/scan/scan_processor.hpp"

#include <utility>

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/propagation.hpp"
#include "fdi_lio/scan/deskew.hpp"

namespace fdi_lio::scan {

ScanProcessor::ScanProcessor(const Config& config, Reporter* reporter)
    : config_(config), reporter_(reporter) {}

DeskewedScan ScanProcessor::process(Scan scan, const std::optional<imu::NavState>& state,
                                    const imu::ImuBuffer& imu) {
  const Stamp scan_begin = add_seconds(scan.stamp, -scan.duration_s);
  // Without an estimate the gyro alone turns the first scan about a point that stands still.
  imu::NavState from;
  from.stamp = scan_begin;
  if (state && state->stamp < scan.stamp && !is_jump(state->stamp, scan.stamp)) from = *state;
  const std::vector<imu::ImuSample> readings = imu.between(from.stamp, scan.stamp);
  const double lacking_s =
      readings.empty() ? scan.duration_s : seconds_between(readings.back().stamp, scan.stamp);
  if (!imu.empty() && lacking_s > config_.imu.max_gap_s) {
    reporter_->report(
        Severity::kWarning, "deskew_imu",
        "IMU readings end before the scan does (longer than imu.max_gap): the rest is deskewed with "
        "constant velocity");
  }
  deskew(&scan, imu::propagate(from, readings, scan.stamp), config_.sensor.T_imu_lidar());
  return order_by_ring(scan);
}

}  // namespace fdi_lio::scan
