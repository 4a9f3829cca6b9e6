#include "slam_run.hpp"

#include <utility>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/new_file.hpp"
#include "fdi_lio/mapping/session_io.hpp"

namespace fdi_lio::tools {

SlamRun::Part::Part(const Config& config, const std::string& output, double begin, Reporter* reporter)
    : begin_s(begin),
      directory(output, config),
      global(config, reporter),
      pipeline(
          config, reporter, [this, config](const pipeline::ScanOutput& result) { add(config, result); },
          [this](const std::string& stage, double ms) { times.add(stage, ms); }) {
  const std::string& session = config.localisation.session;
  if (!session.empty())
    localiser = std::make_unique<mapping::Localiser>(config, mapping::load_session(session), reporter);
}

void SlamRun::Part::add(const Config& config, const pipeline::ScanOutput& output) {
  directory.add(output);
  const imu::NavState& state = output.estimate.state;
  const bool is_due = localiser && localiser->is_due(state.stamp, state.T_odom_imu());
  if (output.estimate.is_keyframe || is_due) {
    const auto begin = std::chrono::steady_clock::now();
    mapping::Keyframe keyframe = {
        state.stamp, state.T_odom_imu(), output.estimate.map_covariance,
        mapping::make_keyframe_cloud(output.scan.points, output.features, config.sensor.T_imu_lidar(),
                                     config.mapping.output_map_voxel_m)};
    if (localiser) {
      localise(keyframe);
    } else {
      global.add(std::move(keyframe));
    }
    times.add("global",
              std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }
  if (localiser && localiser->T_map_odom())
    localised.push_back({state.stamp, *localiser->T_map_odom() * state.T_odom_imu()});
}

void SlamRun::Part::localise(const mapping::Keyframe& scan) {
  if (const auto result = localiser->add(scan)) registrations.push_back(*result);
}

void SlamRun::set_initial_pose(const mapping::InitialPose& pose) {
  if (!part_->localiser) throw Error("an initial pose needs a session to localise in (--localise)");
  part_->localiser->set_initial_pose(pose);
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
  if (part_->localiser) {
    part_->directory.write_localisation(part_->localised, part_->registrations);
  } else {
    write_map();
  }
  const double wall_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - part_->began).count();
  part_->directory.write_timing(part_->times, wall_s, position_s_ - part_->begin_s);
  part_->directory.write_warnings(*reporter_);
}

void SlamRun::write_map() {
  part_->global.finish();
  part_->directory.write_global(part_->global, config_.mapping.output_map_voxel_m);
  if (!config_.loop.save_session) return;
  mapping::SessionOptions options;
  options.map_voxel_m = config_.mapping.output_map_voxel_m;
  mapping::save_session(part_->global, options, free_path((part_->directory.path() / "session").string()));
}

}  // namespace fdi_lio::tools
