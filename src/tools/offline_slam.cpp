#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "bag_source.hpp"
#include "progress_bar.hpp"
#include <tbb/global_control.h>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/evaluation/stage_times.hpp"
#include "fdi_lio/evaluation/trajectory_writer.hpp"
#include "fdi_lio/mapping/map_builder.hpp"
#include "fdi_lio/pipeline/slam_pipeline.hpp"
#include "fdi_lio/version.hpp"

namespace {

using fdi_lio::Error;

const char* const kUsage =
    "usage: offline_slam --config FILE --bag FILE... --output DIR [--set key=value]... [--start S] "
    "[--duration S]\n"
    "Runs a recording through the whole system, without a roscore, as fast as the machine allows.\n"
    "Writes DIR/{trajectory.tum, odometry.tum, map.pcd, degeneracy.csv, timing.json, run.yaml, "
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

std::ofstream open_for_writing(const std::filesystem::path& path) {
  std::ofstream out(path);
  if (!out) throw Error("cannot write " + path.string() + ": check that the folder may be written");
  return out;
}

/// Everything that a run leaves behind; what is complete at any moment stays when the run is cut short.
class RunDirectory {
 public:
  RunDirectory(const std::string& path, const fdi_lio::Config& config)
      : path_(make(path)),
        config_(config),
        trajectory_((path_ / "trajectory.tum").string()),
        odometry_((path_ / "odometry.tum").string()),
        degeneracy_(open_for_writing(path_ / "degeneracy.csv")),
        map_(config.mapping.output_map_voxel_m) {
    std::ofstream run = open_for_writing(path_ / "run.yaml");
    run << "# fdi_lio " << fdi_lio::kVersion << ", every parameter as used\n";
    fdi_lio::write_config(config, run);
    degeneracy_ << "stamp,fdi,structural,sparse,dynamic,weight_structural,weight_sparse,weight_dynamic,class,"
                   "geometric_complexity,curvature_complexity,point_entropy,plane_deviation,gradient_mean,"
                   "gradient_variation,planes,edges,matched,iterations,residual_rms\n";
    degeneracy_.precision(std::numeric_limits<double>::max_digits10);
  }

  void add(const fdi_lio::pipeline::ScanOutput& output) {
    const auto& state = output.estimate.state;
    trajectory_.add(state.stamp, state.q_odom_imu, state.t_odom_imu);
    odometry_.add(state.stamp, state.q_odom_imu, state.t_odom_imu);
    write_degeneracy(output);
    if (output.estimate.is_keyframe)
      map_.add(output.scan.points, state.T_odom_imu() * config_.sensor.T_imu_lidar());
    ++scans_;
  }

  void write_map() const { map_.write_pcd((path_ / "map.pcd").string()); }

  void write_timing(const fdi_lio::evaluation::StageTimes& times, double wall_s, double bag_s) const {
    std::ofstream out = open_for_writing(path_ / "timing.json");
    times.write_json(out, wall_s, bag_s);
  }

  void write_warnings(const fdi_lio::Reporter& reporter) const {
    std::ofstream out = open_for_writing(path_ / "warnings.txt");
    for (const auto& entry : reporter.notices()) {
      if (entry.second.severity == fdi_lio::Severity::kInfo) continue;
      out << entry.second.count << " x " << entry.second.text << "\n";
    }
  }

  std::size_t scans() const { return scans_; }

 private:
  static std::filesystem::path make(const std::string& path) {
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (!std::filesystem::is_directory(path)) {
      throw Error("cannot make the output folder " + path + ": " + error.message());
    }
    return path;
  }

  void write_degeneracy(const fdi_lio::pipeline::ScanOutput& output) {
    static constexpr const char* kClasses[] = {"structured", "sparse", "dynamic", "mixed"};
    const auto& d = output.degeneracy;
    const auto& m = d.metrics;
    char stamp[32];
    std::snprintf(stamp, sizeof(stamp), "%.6f", fdi_lio::to_seconds(output.estimate.state.stamp));
    degeneracy_ << stamp << ',' << d.fdi << ',' << d.sub_factors[0] << ',' << d.sub_factors[1] << ','
                << d.sub_factors[2] << ',' << d.weights[0] << ',' << d.weights[1] << ',' << d.weights[2]
                << ',' << kClasses[static_cast<int>(d.environment)] << ',' << m.geometric_complexity << ','
                << m.curvature_complexity << ',' << m.point_entropy << ',' << m.plane_deviation_m << ','
                << m.gradient_mean << ',' << m.gradient_variation << ',' << output.features.planes.size()
                << ',' << output.features.edges.size() << ',' << output.estimate.status.matched << ','
                << output.estimate.status.iterations << ',' << output.estimate.status.residual_rms_m << '\n';
  }

  std::filesystem::path path_;
  fdi_lio::Config config_;
  fdi_lio::evaluation::TrajectoryWriter trajectory_;
  fdi_lio::evaluation::TrajectoryWriter odometry_;
  std::ofstream degeneracy_;
  fdi_lio::mapping::MapBuilder map_;
  std::size_t scans_ = 0;
};

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
  RunDirectory directory(options.output, config);
  fdi_lio::evaluation::StageTimes times;
  const auto on_timing = [&times](const std::string& stage, double ms) { times.add(stage, ms); };
  fdi_lio::pipeline::SlamPipeline pipeline(
      config, &reporter, [&](const fdi_lio::pipeline::ScanOutput& output) { directory.add(output); },
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
  directory.write_map();
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
