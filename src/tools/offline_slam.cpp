#include <chrono>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include "bag_source.hpp"
#include "progress_bar.hpp"
#include <tbb/global_control.h>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/evaluation/stage_times.hpp"
#include "fdi_lio/pipeline/run_directory.hpp"
#include "fdi_lio/pipeline/slam_pipeline.hpp"

namespace {

using fdi_lio::Error;

const char* const kUsage =
    "usage: offline_slam --config FILE --bag FILE... --output DIR [--set key=value]... [--start S] "
    "[--duration S]\n"
    "Runs a recording through the whole system, without a roscore, as fast as the machine allows.\n"
    "Writes DIR/{trajectory.tum, odometry.tum, map.pcd, degeneracy.csv, covariance.csv, timing.json, "
    "run.yaml, "
    "warnings.txt}.\n";

volatile std::sig_atomic_t stop_requested = 0;

void request_stop(int /*signal*/) { stop_requested = 1; }

struct Options {
  std::string config;
  std::vector<std::string> bags;
  std::string output;
  std::vector<std::string> overrides;
  double start_s = 0.0;
  double duration_s = 0.0;
};

double parse_seconds(const std::string& name, const std::string& text) {
  std::size_t used = 0;
  double value = -1.0;
  try {
    value = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != text.size() || text.empty() || !(value >= 0.0)) {
    throw Error(name + " is '" + text + "', must be a number of seconds of 0 or more");
  }
  return value;
}

Options parse(int argc, char** argv) {
  Options options;
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    const auto value = [&]() -> const std::string& {
      if (i + 1 >= arguments.size()) throw Error(name + " needs a value\n" + kUsage);
      return arguments[++i];
    };
    if (name == "--config") {
      options.config = value();
    } else if (name == "--bag") {
      options.bags.push_back(value());
      while (i + 1 < arguments.size() && arguments[i + 1].rfind("--", 0) != 0)
        options.bags.push_back(arguments[++i]);
    } else if (name == "--output") {
      options.output = value();
    } else if (name == "--set") {
      options.overrides.push_back(value());
    } else if (name == "--start") {
      options.start_s = parse_seconds(name, value());
    } else if (name == "--duration") {
      options.duration_s = parse_seconds(name, value());
    } else if (name == "--help" || name == "-h") {
      std::cout << kUsage;
      std::exit(0);
    } else {
      throw Error("unknown argument '" + name + "'\n" + kUsage);
    }
  }
  if (options.config.empty() || options.bags.empty() || options.output.empty()) {
    throw Error(std::string("--config, --bag and --output are needed\n") + kUsage);
  }
  return options;
}

void print_new(fdi_lio::Reporter* reporter) {
  static constexpr const char* kNames[] = {"info", "warning", "error"};
  for (const fdi_lio::Notice& notice : reporter->take_new()) {
    std::cerr << kNames[static_cast<int>(notice.severity)] << ": " << notice.text;
    if (notice.count > 1) std::cerr << " (" << notice.count << " times so far)";
    std::cerr << "\n";
  }
}

int run(const Options& options) {
  const auto begin = std::chrono::steady_clock::now();
  const fdi_lio::Config config = fdi_lio::load_config(options.config, options.overrides);
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(config.threads));
  fdi_lio::Reporter reporter;
  fdi_lio::tools::BagSource source(options.bags, config.sensor, &reporter);
  fdi_lio::pipeline::RunDirectory directory(options.output, config);
  fdi_lio::mapping::MapBuilder map(config.mapping.output_map_voxel_m);
  fdi_lio::evaluation::StageTimes times;
  const auto on_timing = [&times](const std::string& stage, double ms) { times.add(stage, ms); };
  fdi_lio::pipeline::SlamPipeline pipeline(
      config, &reporter,
      [&](const fdi_lio::pipeline::ScanOutput& output) {
        directory.add(output);
        if (output.estimate.is_keyframe)
          map.add(output.scan.points, output.estimate.state.T_odom_imu() * config.sensor.T_imu_lidar());
      },
      on_timing);

  const double bag_s = source.duration_s(options.start_s, options.duration_s);
  fdi_lio::tools::ProgressBar progress(bag_s);
  double read_s = 0.0;
  fdi_lio::tools::BagCallbacks callbacks;
  callbacks.on_imu = [&](const fdi_lio::imu::ImuSample& sample) { pipeline.add_imu(sample); };
  callbacks.on_scan = [&](fdi_lio::Scan scan) { pipeline.add_scan(std::move(scan)); };
  callbacks.on_timing = on_timing;
  callbacks.on_progress = [&](double position_s) {
    read_s = position_s;
    progress.update(position_s);
    print_new(&reporter);
    return stop_requested == 0;
  };
  source.read(options.start_s, options.duration_s, callbacks);
  pipeline.finish();
  progress.finish();
  print_new(&reporter);
  directory.write_map(map);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  directory.write_timing(times, wall_s, read_s);
  directory.write_warnings(reporter);
  if (directory.scans() == 0) throw Error("no scan of the recording could be used: see the messages above");
  std::cerr << directory.scans() << " scans, " << read_s << " s of data in " << wall_s << " s; results in "
            << options.output << "\n";
  return stop_requested == 0 ? 0 : 130;
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  try {
    return run(parse(argc, argv));
  } catch (const Error& error) {
    std::cerr << "offline_slam: " << error.what() << "\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "offline_slam: unexpected error: " << error.what() << "\n";
    return 3;
  }
}
