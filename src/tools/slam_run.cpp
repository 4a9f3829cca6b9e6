#include "slam_run.hpp"

#include <utility>

#include "fdi_lio/mapping/session_io.hpp"

namespace fdi_lio::tools {

SlamRun::Part::Part(const Config& config, const std::string& output, double begin, Reporter* reporter)
    : begin_s(begin),
      directory(output, config),
      global(config, reporter),
      pipeline(
          config, reporter, [this, config](const pipeline::ScanOutput& result) { add(config, result); },
          [this](const std::string& stage, double ms) { times.add(stage, ms); }) {}

void SlamRun::Part::add(const Config& config, const pipeline::ScanOutput& output) {
  directory.add(output);
  if (!output.estimate.is_keyframe) return;
  const auto begin = std::chrono::steady_clock::now();
  global.add({output.estimate.state.stamp, output.estimate.state.T_odom_imu(), output.estimate.map_covariance,
              mapping::make_keyframe_cloud(output.scan.points, output.features, config.sensor.T_imu_lidar(),
                                           config.mapping.output_map_voxel_m)});
  times.add("global",
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
}

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
  part_->global.finish();
  part_->directory.write_global(part_->global, config_.mapping.output_map_voxel_m);
  if (config_.loop.save_session) {
    const std::string session = (part_->directory.path() / "session").string();
    mapping::save_session(part_->global, config_.mapping.output_map_voxel_m,
                          mapping::free_session_path(session));
  }
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - part_->began).count();
  part_->directory.write_timing(part_->times, wall_s, position_s_ - part_->begin_s);
  part_->directory.write_warnings(*reporter_);
}

}  // namespace fdi_lio::tools
