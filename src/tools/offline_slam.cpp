#include <chrono>
#include <cmath>
#include <csignal>
#include <iostream>
#include <optional>
#include <string>
#include <utility>

#include "bag_options.hpp"
#include "bag_source.hpp"
#include "notice_log.hpp"
#include "progress_bar.hpp"
#include "slam_run.hpp"
#include "start_check.hpp"
#include <tbb/global_control.h>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/memory.hpp"

namespace {

using fdi_lio::Error;

const char* const kUsage =
    "usage: offline_slam --config FILE --bag FILE... --output DIR [--set key=value]... [--start S] "
    "[--duration S]\n"
    "                    [--localise SESSION [--initial-pose 'x y yaw']]\n"
    "Runs a recording through the whole system, without a roscore, as fast as the machine allows.\n"
    "Writes DIR/{trajectory.tum, odometry.tum, map.pcd, loops.csv, fixes.csv, trajectory_enu.tum, "
    "georeference.yaml, degeneracy.csv, "
    "covariance.csv, directions.csv, timing.json, run.yaml, "
    "warnings.txt}.\n"
    "With --localise the poses are those in a saved session (loop.save_session, save_map), which stays as it "
    "is: trajectory.tum\n"
    "begins when the place was found, localisation.csv has every registration, and there is no map. "
    "--initial-pose: x y [m], yaw [deg].\n"
    "First compares the first seconds with the configuration, as check_bag does (--set check.enabled=false: "
    "not).\n"
    "Exit code: 0 done, 2 not possible as asked (the message says why), 130 interrupted.\n";

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int /*signal*/) { stop_requested = 1; }

fdi_lio::localisation::InitialPose initial_pose(const fdi_lio::tools::BagOptions& options,
                                                const fdi_lio::Config& config) {
  constexpr double kDegree = M_PI / 180.0;
  return {options.initial_pose[0], options.initial_pose[1], options.initial_pose[2] * kDegree,
          config.localisation.initial_sigma_translation_m,
          config.localisation.initial_sigma_rotation_deg * kDegree};
}

int run(const fdi_lio::tools::BagOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const fdi_lio::Config config = fdi_lio::load_config(options.config, options.overrides);
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(config.threads));
  fdi_lio::Reporter reporter;
  fdi_lio::tools::BagSource source(options.bags, config.sensor, &reporter);
  if (config.check.enabled) fdi_lio::tools::require_good_start(&source, config, options.start_s, &reporter);
  fdi_lio::tools::SlamRun slam(config, options.output, &reporter);
  if (!options.initial_pose.empty()) slam.set_initial_pose(initial_pose(options, config));
  fdi_lio::tools::ProgressBar progress(source.duration_s(options.start_s, options.duration_s));
  double read_s = 0.0;
  fdi_lio::tools::BagCallbacks callbacks;
  callbacks.on_imu = [&](const fdi_lio::imu::ImuSample& sample) { slam.add_imu(sample); };
  callbacks.on_scan = [&](fdi_lio::Scan scan) { slam.add_scan(std::move(scan)); };
  if (config.gnss.enabled)
    callbacks.on_fix = [&](const fdi_lio::mapping::GnssFix& fix) { slam.add_fix(fix); };
  if (config.external_odometry.enabled)
    callbacks.on_external = [&](const fdi_lio::mapping::ExternalPose& pose) { slam.add_external(pose); };
  callbacks.on_timing = [&](const std::string& stage, double ms) { slam.add_timing(stage, ms); };
  callbacks.on_progress = [&](double position_s) {
    read_s = position_s;
    slam.advance(position_s);
    progress.update(position_s);
    fdi_lio::tools::print_new(&reporter);
    return stop_requested == 0;
  };
  // Of a damaged recording the results up to the damage are kept.
  std::optional<Error> damage;
  try {
    source.read(options.start_s, options.duration_s, &reporter, callbacks);
  } catch (const Error& error) {
    damage = error;
  }
  slam.finish();
  progress.finish();
  fdi_lio::tools::print_new(&reporter);
  if (damage) throw Error(*damage);
  if (slam.scans() == 0) throw Error("no scan of the recording could be used: see the messages above");
  if (!slam.is_placed())
    throw Error("the place was not found in the session: " + options.output +
                "/localisation.csv says why; give --initial-pose, or see whether it is the right session");
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::cerr << slam.scans() << " scans, " << read_s << " s of data in " << wall_s << " s; results in "
            << options.output << "\n";
  return stop_requested == 0 ? 0 : 130;
}

}  // namespace

int main(int argc, char** argv) {
  fdi_lio::keep_freed_memory();
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  try {
    return run(fdi_lio::tools::parse_bag_options(argc, argv, kUsage, true));
  } catch (const Error& error) {
    std::cerr << "offline_slam: " << error.what() << "\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "offline_slam: unexpected error: " << error.what() << "\n";
    return 3;
  }
}
