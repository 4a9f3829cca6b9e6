#include "slam_run.hpp"

#include <utility>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/new_file.hpp"
#include "fdi_lio/mapping/session_io.hpp"

namespace fdi_lio::tools {

namespace {

/// Scans that may wait for the map: each holds its points.
constexpr std::size_t kBacklog = 20;

}  // namespace

SlamRun::Part::Part(const Config& settings, const std::string& output, double begin, Reporter* reporter)
    : config(settings),
      begin_s(begin),
      directory(output, config),
      keyframes(config.sensor.T_imu_lidar(), config.mapping.output_map_voxel_m),
      global(config, reporter),
      pipeline(
          config, reporter, [this](pipeline::ScanOutput result) { add(std::move(result)); },
          [this](const std::string& stage, double ms) { times.add(stage, ms); }) {
  const std::string& session = config.localisation.session;
  if (!session.empty())
    localiser = std::make_unique<localisation::Localiser>(config, mapping::load_session(session), reporter);
}

void SlamRun::Part::add(pipeline::ScanOutput output) {
  directory.add(output);
  const imu::NavState state = output.estimate.state;
  const bool is_due = localiser && localiser->is_due(state.stamp, state.T_odom_imu());
  if (output.estimate.is_keyframe || is_due) {
    const auto make = [this, output = std::make_shared<pipeline::ScanOutput>(std::move(output))] {
      return keyframes.make(output->estimate, std::move(output->scan), output->features);
    };
    if (localiser) {
      localise(make());
    } else {
      add_to_map(make);
    }
  }
  if (localiser && localiser->T_map_odom())
    localised.push_back({state.stamp, *localiser->T_map_odom() * state.T_odom_imu()});
}

void SlamRun::Part::add_to_map(std::function<mapping::Keyframe()> make) {
  if (const std::string error = global.error(); !error.empty()) throw Error(error);
  global.wait_for_room(kBacklog);
  global.add(std::move(make));
}

void SlamRun::Part::localise(const mapping::Keyframe& scan) {
  const auto begin = std::chrono::steady_clock::now();
  if (const auto result = localiser->add(scan)) registrations.push_back(*result);
  times.add("global",
            std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
}

void SlamRun::set_initial_pose(const localisation::InitialPose& pose) {
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
  for (const double ms : part_->global.durations_ms()) part_->times.add("global", ms);
  part_->directory.write_timing(part_->times, wall_s, position_s_ - part_->begin_s);
  part_->directory.write_warnings(*reporter_);
  if (const std::string error = part_->global.error(); !error.empty()) throw Error(error);
}

void SlamRun::write_map() {
  const mapping::GlobalOptimizer& global = part_->global.finish();
  if (global.size() == 0) {
    reporter_->report(
        Severity::kWarning, "empty_map",
        "no scan became a keyframe, so that map.pcd is empty: the recording has no scans, or only "
        "one or two of a sensor that already moves");
  }
  part_->directory.write_global(global, config_.mapping.output_map_voxel_m);
  if (!config_.loop.save_session) return;
  mapping::SessionOptions options;
  options.map_voxel_m = config_.mapping.output_map_voxel_m;
  mapping::save_session(global, options, free_path((part_->directory.path() / "session").string()));
}

}  // namespace fdi_lio::tools
