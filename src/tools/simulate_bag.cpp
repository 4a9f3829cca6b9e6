// simulate_bag: draws a place from a scenario and a seed, drives through it, and writes what the sensors
// would have recorded as a bag, with the ground truth beside it.

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "progress_bar.hpp"
#include "simulate_options.hpp"
#include "simulated_messages.hpp"
#include <rosbag/bag.h>
#include <tbb/global_control.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include "fdi_lio/simulation/cloud_encoding.hpp"
#include "fdi_lio/simulation/gnss_simulator.hpp"
#include "fdi_lio/simulation/imu_simulator.hpp"
#include "fdi_lio/simulation/lidar_simulator.hpp"
#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/sidecar_files.hpp"
#include "fdi_lio/simulation/wheel_simulator.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace {

using fdi_lio::add_seconds;
using fdi_lio::Error;
using fdi_lio::Stamp;
namespace fs = std::filesystem;
namespace sim = fdi_lio::simulation;
namespace tools = fdi_lio::tools;
using fdi_lio::ros_bridge::to_ros_time;
using tools::SimulateOptions;
using tools::to_message;

constexpr Stamp kStart = 1700000000LL * 1000000000LL;  // stamp of t = 0 in every recording
constexpr double kImuLatency = 0.001;                  // seconds
constexpr double kGnssLatency = 0.05;
constexpr double kWheelLatency = 0.002;
constexpr double kOdometryRate = 100.0;  // Hz
constexpr int kBatch = 8;                // scans in memory at a time

/// Files of one recording. They get their final names only when all of them are complete.
class Files {
 public:
  explicit Files(const std::string& bag) : stem_(fs::path(bag).replace_extension().string()) {}
  ~Files() {
    std::error_code ignored;
    for (const std::string& ending : kEndings) fs::remove(working(ending), ignored);
  }
  std::string working(const std::string& ending) const { return stem_ + ending + ".active"; }
  void publish() const {
    for (const std::string& ending : kEndings) fs::rename(working(ending), stem_ + ending);
  }

 private:
  const std::vector<std::string> kEndings{".tum", ".labels", ".yaml", ".config.yaml", ".bag"};
  std::string stem_;
};

/// The place with its first drive, which reaches as far as the one that is recorded.
sim::Place make_place(sim::Scenario scenario, const SimulateOptions& options) {
  scenario.duration_s += options.revisit_s.value_or(0.0);
  return sim::make_place(scenario, options.seed);
}

/// The drive that is recorded: the first one (movers may follow it, so it stays where it is) or another.
std::unique_ptr<sim::Trajectory> choose_drive(sim::Trajectory first, const sim::Scenario& scenario,
                                              const SimulateOptions& options) {
  if (!options.revisit_s) return std::make_unique<sim::Trajectory>(std::move(first));
  return std::make_unique<sim::Trajectory>(
      sim::revisit(first, *options.revisit_s, options.reversed, scenario.duration_s));
}

/// Runs the sensors side by side and writes their messages in the order of their reception.
class Recorder {
 public:
  Recorder(const sim::Scenario& scenario, const SimulateOptions& options, std::uint64_t noise_seed,
           const Files& files)
      : scenario_(scenario),
        place_(make_place(scenario, options)),
        drive_(choose_drive(*place_.trajectory, scenario, options)),
        model_(sim::make_lidar_model(scenario.lidar)),
        lidar_(*place_.world, *drive_, model_, sim::draw_lidar_errors(scenario, model_, noise_seed),
               scenario.world.dust_per_m, scenario.lidar, noise_seed),
        imu_(*drive_, scenario.imu, scenario.imperfections, noise_seed),
        gnss_(*drive_, scenario.gnss, noise_seed),
        wheels_(*drive_, scenario.wheels, noise_seed),
        tum_(files.working(".tum")),
        labels_(files.working(".labels")) {
    bag_->open(files.working(".bag"), rosbag::bagmode::Write);
    bag_->setCompression(rosbag::compression::Uncompressed);
  }

  void run(std::uint64_t seed, const Files& files) {
    try {
      record(seed, files);
    } catch (...) {
      // The destructor of a bag writes its index; on a full disk that would throw out of a destructor. Files
      // removes what there is.
      static_cast<void>(bag_.release());
      throw;
    }
  }

 private:
  void record(std::uint64_t seed, const Files& files) {
    const int scans = static_cast<int>(scenario_.duration_s * model_.rate_hz);
    tools::ProgressBar progress(scenario_.duration_s);
    first_ = next_ = imu_.next();
    fix_ = gnss_.next();
    wheel_reading_ = wheels_.next();
    for (int begin = 0; begin < scans; begin += kBatch) {
      const int count = std::min(kBatch, scans - begin);
      std::vector<Scan> batch(static_cast<std::size_t>(count));
      fdi_lio::parallel_chunks(batch.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
        batch[i] = simulate(begin + static_cast<int>(i));
      });
      for (const Scan& scan : batch) write(scan);
      progress.update((begin + count) / model_.rate_hz);
    }
    progress.finish();
    bag_->close();
    tum_.close();
    labels_.close();
    sim::write_truth(files.working(".yaml"), scenario_, seed, place_.tunnel_begin_x_m, lidar_.errors(),
                     imu_.axes(), first_, next_);
    sim::write_system_config(files.working(".config.yaml"), scenario_, model_);
  }
  /// A scan as it is written.
  struct Scan {
    Stamp stamp = 0;
    double received_s = 0.0;
    std::vector<std::int16_t> labels;
    sensor_msgs::PointCloud2 message;
  };

  Scan simulate(int index) const {
    const sim::LidarScan scan = lidar_.simulate(index);
    const bool ouster = model_.layout == sim::CloudLayout::kOuster;
    const bool at_end = scenario_.lidar.stamp_at_end && !ouster;
    sim::EncodedCloud cloud = sim::encode_cloud(scan, model_.layout, at_end);
    Scan result;
    result.stamp = add_seconds(kStart, scan.start_s + lidar_.errors().time_offset_s +
                                           (at_end ? scan.column_time(scan.columns - 1) : 0.0));
    result.received_s = scan.start_s + scan.period_s + scenario_.lidar.latency_s;
    result.labels = std::move(cloud.labels);
    result.message = to_message(std::move(cloud), result.stamp, ouster ? "os_sensor" : "velodyne");
    return result;
  }

  void write(const Scan& scan) {
    write_until(scan.received_s);
    bag_->write("/points_raw", to_ros_time(add_seconds(kStart, scan.received_s)), scan.message);
    labels_.add(scan.stamp, scan.labels);
  }

  /// What the slower streams of messages have received before `time`, seconds.
  void write_until(double time) {
    for (;;) {
      const double imu = next_.time_s + kImuLatency;
      const double odometry = static_cast<double>(odometry_count_) / kOdometryRate;
      const double fix =
          scenario_.gnss.enabled ? fix_.time_s + kGnssLatency : std::numeric_limits<double>::max();
      const double wheels = scenario_.wheels.enabled ? wheel_reading_.time_s + kWheelLatency
                                                     : std::numeric_limits<double>::max();
      const double first = std::min({imu, odometry, fix, wheels});
      if (first >= time) return;
      if (first == odometry) {
        write_odometry(odometry);
      } else if (first == imu) {
        write_imu();
      } else if (first == wheels) {
        bag_->write("/wheel_odometry", to_ros_time(add_seconds(kStart, wheels)),
                    to_message(wheel_reading_, scenario_.wheels, add_seconds(kStart, wheel_reading_.time_s)));
        wheel_reading_ = wheels_.next();
      } else {
        bag_->write("/gps/fix", to_ros_time(add_seconds(kStart, fix)),
                    to_message(fix_, scenario_.gnss, add_seconds(kStart, fix_.time_s)));
        fix_ = gnss_.next();
      }
    }
  }

  void write_odometry(double time) {
    const Stamp stamp = add_seconds(kStart, time);
    bag_->write("/ground_truth/odometry", to_ros_time(stamp), to_message(drive_->evaluate(time), stamp));
    ++odometry_count_;
  }

  void write_imu() {
    const Stamp received = add_seconds(kStart, next_.time_s + kImuLatency);
    bag_->write("/imu_raw", to_ros_time(received),
                to_message(next_, scenario_.imu, add_seconds(kStart, next_.time_s)));
    tum_.add(add_seconds(kStart, next_.time_s), drive_->pose(next_.time_s));
    next_ = imu_.next();
  }

  sim::Scenario scenario_;
  sim::Place place_;
  std::unique_ptr<sim::Trajectory> drive_;
  sim::LidarModel model_;
  sim::LidarSimulator lidar_;
  sim::ImuSimulator imu_;
  sim::GnssSimulator gnss_;
  sim::WheelSimulator wheels_;
  sim::TumWriter tum_;
  sim::LabelWriter labels_;
  std::unique_ptr<rosbag::Bag> bag_ = std::make_unique<rosbag::Bag>();
  sim::ImuReading first_, next_;
  sim::GnssFix fix_;
  sim::WheelReading wheel_reading_;
  std::int64_t odometry_count_ = 0;
};

void run(int argc, char** argv) {
  const SimulateOptions options = tools::parse_simulate_options(argc, argv);
  std::unique_ptr<tbb::global_control> limit;
  if (options.threads > 0) {
    limit = std::make_unique<tbb::global_control>(tbb::global_control::max_allowed_parallelism,
                                                  static_cast<std::size_t>(options.threads));
  }
  const sim::Scenario scenario = sim::load_scenario(options.scenario, options.overrides);
  const Files files(options.output);
  try {
    Recorder recorder(scenario, options, options.noise_seed.value_or(options.seed), files);
    recorder.run(options.seed, files);
  } catch (const rosbag::BagException& error) {
    throw Error("cannot write the bag " + options.output + " (" + error.what() +
                "): check the folder, its permissions and the space on the disk");
  }
  files.publish();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run(argc, argv);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "simulate_bag: " << error.what() << "\n";
  }
  return 2;
}
