#include "slam_run.hpp"

#include <utility>

namespace fdi_lio::tools {

SlamRun::Part::Part(const Config& config, const std::string& output, double begin, Reporter* reporter)
    : begin_s(begin),
      directory(output, config),
      map(config.mapping.output_map_voxel_m),
      pipeline(
          config, reporter,
          [this, T_imu_lidar = config.sensor.T_imu_lidar()](const pipeline::ScanOutput& result) {
            directory.add(result);
            if (result.estimate.is_keyframe)
              map.add(result.scan.points, result.estimate.state.T_odom_imu() * T_imu_lidar);
          },
          [this](const std::string& stage, double ms) { times.add(stage, ms); }) {}

SlamRun::SlamRun(const Config& config, const std::string& output, Reporter* reporter)
    : config_(config),
      output_(output),
      reporter_(reporter),
      part_(std::make_unique<Part>(config, output, 0.0, reporter)) {}

void SlamRun::add_imu(const imu::ImuSample& sample) { part_->pipeline.add_imu(sample); }

void SlamRun::add_scan(Scan scan) {
  switch (guard_.check(scan.stamp)) {
    case StampVerdict::kDrop:
      reporter_->report(Severity::kWarning, "scan_order",
                        "a scan was dropped: its stamp does not follow the one before");
      return;
    case StampVerdict::kRestart:
      begin_anew();
      break;
    case StampVerdict::kAccept:
      break;
  }
  part_->pipeline.add_scan(std::move(scan));
}

void SlamRun::begin_anew() {
  finish();
  const std::string output = output_ + "_" + std::to_string(++parts_);
  reporter_->report(
      Severity::kWarning, "scan_jump",
      "the stamps of the scans jumped by more than 10 s: starting anew, results from there on are "
      "in " +
          output);
  finished_scans_ += part_->directory.scans();
  part_ = std::make_unique<Part>(config_, output, position_s_, reporter_);
}

void SlamRun::finish() {
  part_->pipeline.finish();
  part_->directory.write_map(part_->map);
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - part_->began).count();
  part_->directory.write_timing(part_->times, wall_s, position_s_ - part_->begin_s);
  part_->directory.write_warnings(*reporter_);
}

}  // namespace fdi_lio::tools
