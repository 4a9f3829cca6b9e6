#include "fdi_lio/scan/scan_processor.hpp"

#include <utility>

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/propagation.hpp"
#include "fdi_lio/scan/deskew.hpp"

namespace fdi_lio::scan {

ScanProcessor::ScanProcessor(const Config& config, Reporter* reporter)
    : config_(config),
      reporter_(reporter),
      intensity_(config.intensity, reporter),
      gradient_(config.gradient),
      smoother_(config.gradient),
      dynamic_(config.dynamic) {}

DeskewedScan ScanProcessor::process(Scan scan, const std::optional<imu::NavState>& state,
                                    const imu::ImuBuffer& imu) {
  const Stamp scan_begin = add_seconds(scan.stamp, -scan.duration_s);
  // Without an estimate the gyro alone turns the first scan about a point that stands still.
  imu::NavState from;
  from.stamp = scan_begin;
  const bool has_state = state && state->stamp < scan.stamp && !is_jump(state->stamp, scan.stamp);
  if (has_state) from = *state;
  const std::vector<imu::ImuSample> readings = imu.between(from.stamp, scan.stamp);
  const double lacking_s =
      readings.empty() ? scan.duration_s : seconds_between(readings.back().stamp, scan.stamp);
  if (!imu.empty() && lacking_s > config_.imu.max_gap_s) {
    reporter_->report(
        Severity::kWarning, "deskew_imu",
        "IMU readings end before the scan does (longer than imu.max_gap): the rest is deskewed with "
        "constant velocity");
  }
  const std::vector<imu::NavState> trajectory = imu::propagate(from, readings, scan.stamp);
  const Eigen::Isometry3d T_imu_lidar = config_.sensor.T_imu_lidar();
  deskew(&scan, trajectory, T_imu_lidar);
  DeskewedScan ordered = order_by_ring(scan);
  std::optional<Eigen::Isometry3d> T_previous_lidar;
  if (has_state && state->stamp == previous_stamp_) {
    T_previous_lidar =
        (state->T_odom_imu() * T_imu_lidar).inverse() * trajectory.back().T_odom_imu() * T_imu_lidar;
  }
  previous_stamp_ = scan.stamp;
  if (has_state) dynamic_.correct_newest(state->stamp, state->T_odom_imu() * T_imu_lidar);
  image_.build(&ordered);
  add_intensity(T_previous_lidar, &ordered);
  remove_points(dynamic_.classify(ordered, image_, trajectory.back().T_odom_imu() * T_imu_lidar), &ordered);
  return ordered;
}

void ScanProcessor::add_intensity(const std::optional<Eigen::Isometry3d>& T_previous_lidar,
                                  DeskewedScan* scan) {
  scan->intensity_level = intensity_.apply(*scan, image_);
  if (scan->intensity_level.empty()) {
    smoother_.reset();
    return;
  }
  scan->intensity_gradient = gradient_.compute(*scan, scan->intensity_level, image_);
  if (config_.gradient.smoothing)
    scan->gradient_stability = smoother_.update(*scan, image_, T_previous_lidar, &scan->intensity_gradient);
}

}  // namespace fdi_lio::scan
