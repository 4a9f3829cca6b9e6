#include "fdi_lio/scan/scan_processor.hpp"

#include <utility>

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/propagation.hpp"
#include "fdi_lio/scan/deskew.hpp"
#include "fdi_lio/scan/isolated_points.hpp"
#include "fdi_lio/scan/point_removal.hpp"

namespace fdi_lio::scan {

ScanProcessor::ScanProcessor(const Config& config, Reporter* reporter, StageTimer timer)
    : config_(config),
      reporter_(reporter),
      timer_(std::move(timer)),
      intensity_(config.intensity, reporter),
      gradient_(config.gradient),
      smoother_(config.gradient),
      dynamic_(config.dynamic) {}

DeskewedScan ScanProcessor::process(Scan scan, const std::optional<imu::NavState>& newest,
                                    const imu::ImuBuffer& imu) {
  const bool has_state = newest && newest->stamp < scan.stamp && !is_jump(newest->stamp, scan.stamp);
  const std::optional<imu::NavState> state = has_state ? newest : std::nullopt;
  const std::vector<imu::NavState> trajectory = predict(scan, state, imu);
  DeskewedScan ordered = timer_.timed("deskew", [&] { return make_ordered(&scan, trajectory); });
  const Eigen::Isometry3d T_imu_lidar = config_.sensor.T_imu_lidar();
  const Eigen::Isometry3d T_odom_lidar = trajectory.back().T_odom_imu() * T_imu_lidar;
  std::optional<Eigen::Isometry3d> T_previous_lidar;
  if (state && state->stamp == previous_stamp_)
    T_previous_lidar = (state->T_odom_imu() * T_imu_lidar).inverse() * T_odom_lidar;
  previous_stamp_ = scan.stamp;
  if (state) dynamic_.correct_newest(state->stamp, state->T_odom_imu() * T_imu_lidar);
  std::vector<RemovalReason> moving;
  const auto add_level_and_gradient = [&] { add_intensity(T_previous_lidar, &ordered); };
  const auto find_moving = [&] { moving = dynamic_.classify(ordered, image_, T_odom_lidar); };
  if (dynamic_.needs_gradient()) {
    timer_.timed("intensity", add_level_and_gradient);
    timer_.timed("dynamic", find_moving);
  } else {
    timer_.timed_together("intensity", add_level_and_gradient, "dynamic", find_moving);
  }
  remove_points(moving, &ordered);
  return ordered;
}

std::vector<imu::NavState> ScanProcessor::predict(const Scan& scan, const std::optional<imu::NavState>& state,
                                                  const imu::ImuBuffer& imu) const {
  // Without an estimate the gyro alone turns the first scan about a point that stands still.
  imu::NavState from;
  from.stamp = add_seconds(scan.stamp, -scan.duration_s);
  if (state) from = *state;
  const std::vector<imu::ImuSample> readings = imu.between(from.stamp, scan.stamp, from.lidar_time_offset_s);
  const double lacking_s =
      readings.empty() ? scan.duration_s : seconds_between(readings.back().stamp, scan.stamp);
  if (!imu.empty() && lacking_s > config_.imu.max_gap_s) {
    reporter_->report(
        Severity::kWarning, "deskew_imu",
        "IMU readings end before the scan does (longer than imu.max_gap): the rest is deskewed with "
        "constant velocity");
  }
  return imu::propagate(from, readings, scan.stamp);
}

DeskewedScan ScanProcessor::make_ordered(Scan* scan, const std::vector<imu::NavState>& trajectory) {
  const Sweep sweep = deskew(scan, trajectory, config_.sensor.T_imu_lidar());
  DeskewedScan ordered = order_by_ring(*scan);
  ordered.sweep = sweep;
  image_.build(&ordered);
  const std::vector<RemovalReason> isolated = find_isolated(ordered, image_, config_.isolation);
  if (!isolated.empty()) {
    image_.remove(isolated);
    remove_points(isolated, &ordered);
  }
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
