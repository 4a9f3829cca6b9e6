// simulate_bag: draws a place from a scenario and a seed, drives through it, and writes what the sensors
// would have recorded as a bag, with the ground truth beside it. Argument parsing and bag writing only.

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/simulation/cloud_encoding.hpp"
#include "fdi_lio/simulation/gnss_simulator.hpp"
#include "fdi_lio/simulation/imu_simulator.hpp"
#include "fdi_lio/simulation/lidar_simulator.hpp"
#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/sidecar_files.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace {

using fdi_lio::add_seconds;
using fdi_lio::Error;
using fdi_lio::Stamp;
namespace fs = std::filesystem;
namespace sim = fdi_lio::simulation;

constexpr Stamp kStart = 1700000000LL * 1000000000LL;  // stamp of t = 0 in every recording
constexpr double kImuLatency = 0.001;                  // seconds
constexpr double kGnssLatency = 0.05;
constexpr double kOdometryRate = 100.0;  // Hz
constexpr int kBatch = 8;                // scans in memory at a time

struct Options {
  std::string scenario;
  std::string output;
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> noise_seed;  ///< of the sensors' errors; empty: the same
  std::optional<double> revisit_s;  ///< another drive, from where the first one is then; empty: the first one
  bool reversed = false;            ///< the other drive goes back
  int threads = 0;
  std::vector<std::string> overrides;
};

const char kUsage[] =
    "usage: simulate_bag --scenario config/scenarios/NAME.yaml --output FILE.bag [--seed N] [--duration "
    "SECONDS]\n"
    "                    [--set key=value]... [--threads N] [--noise-seed N]\n"
    "                    [--revisit SECONDS [--reversed yes]]\n"
    "Writes FILE.bag (/points_raw /imu_raw /ground_truth/odometry, /gps/fix if enabled), and beside it "
    "FILE.tum (truth), "
    "FILE.labels\n"
    "(moving object of each point), FILE.yaml (what was drawn), FILE.config.yaml (parameters for fdi_lio).\n";

ros::Time ros_time(Stamp stamp) {
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(stamp));
  return time;
}

long whole_number(const std::string& name, const std::string& text, long min, long max) {
  char* end = nullptr;
  errno = 0;
  const long value = std::strtol(text.c_str(), &end, 10);
  if (text.empty() || *end != '\0' || errno != 0 || value < min || value > max) {
    throw Error(name + " '" + text + "' must be a whole number from " + std::to_string(min) + " to " +
                std::to_string(max));
  }
  return value;
}

Options parse_arguments(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--help" || name == "-h") {
      std::cout << kUsage;
      std::exit(0);
    }
    if (i + 1 >= argc) throw Error("'" + name + "' is unknown or lacks its value\n" + kUsage);
    const std::string value = argv[++i];
    if (name == "--scenario")
      options.scenario = value;
    else if (name == "--output")
      options.output = value;
    else if (name == "--seed")
      options.seed = static_cast<std::uint64_t>(whole_number(name, value, 0, 2147483647));
    else if (name == "--noise-seed")
      options.noise_seed = static_cast<std::uint64_t>(whole_number(name, value, 0, 2147483647));
    else if (name == "--revisit")
      options.revisit_s = static_cast<double>(whole_number(name, value, 0, 7200));
    else if (name == "--reversed")
      options.reversed = value == "yes";
    else if (name == "--duration")
      options.overrides.push_back("duration=" + value);
    else if (name == "--set")
      options.overrides.push_back(value);
    else if (name == "--threads")
      options.threads = static_cast<int>(whole_number(name, value, 1, 256));
    else
      throw Error("unknown option '" + name + "'\n" + kUsage);
  }
  if (options.scenario.empty() || options.output.empty())
    throw Error(std::string("--scenario and --output are needed\n") + kUsage);
  if (fs::path(options.output).extension() != ".bag")
    throw Error("--output '" + options.output + "' must end in .bag");
  return options;
}

/// Progress with the time left, on terminals only.
class Progress {
 public:
  explicit Progress(int total) : total_(total), shown_(isatty(STDERR_FILENO) != 0) {}

  void update(int done) const {
    if (!shown_) return;
    constexpr int kWidth = 40;
    const double share = static_cast<double>(done) / total_;
    const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    const int filled = static_cast<int>(share * kWidth);
    std::fprintf(stderr, "\r[%s%s] %3.0f %%  %.0f s left   ",
                 std::string(static_cast<std::size_t>(filled), '#').c_str(),
                 std::string(static_cast<std::size_t>(kWidth - filled), ' ').c_str(), 100.0 * share,
                 share > 0.0 ? elapsed * (1.0 - share) / share : 0.0);
    if (done == total_) std::fprintf(stderr, "\n");
  }

 private:
  int total_;
  bool shown_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

sensor_msgs::PointCloud2 cloud_message(sim::EncodedCloud cloud, Stamp stamp, const std::string& frame) {
  sensor_msgs::PointCloud2 message;
  message.header.stamp = ros_time(stamp);
  message.header.frame_id = frame;
  message.height = cloud.height;
  message.width = cloud.width;
  message.point_step = cloud.point_step;
  message.row_step = cloud.point_step * cloud.width;
  message.is_dense = cloud.is_dense;
  message.data = std::move(cloud.data);
  for (const sim::EncodedField& field : cloud.fields) {
    sensor_msgs::PointField f;
    f.name = field.name;
    f.offset = field.offset;
    f.datatype = field.datatype;
    f.count = 1;
    message.fields.push_back(f);
  }
  return message;
}

sensor_msgs::Imu imu_message(const sim::ImuReading& reading, const sim::ImuSettings& settings) {
  sensor_msgs::Imu message;
  message.header.stamp = ros_time(add_seconds(kStart, reading.time_s));
  message.header.frame_id = "imu_link";
  message.angular_velocity.x = reading.gyro.x();
  message.angular_velocity.y = reading.gyro.y();
  message.angular_velocity.z = reading.gyro.z();
  message.linear_acceleration.x = reading.accel.x();
  message.linear_acceleration.y = reading.accel.y();
  message.linear_acceleration.z = reading.accel.z();
  const bool oriented = settings.nine_axis;
  message.orientation.w = oriented ? reading.orientation.w() : 0.0;
  message.orientation.x = oriented ? reading.orientation.x() : 0.0;
  message.orientation.y = oriented ? reading.orientation.y() : 0.0;
  message.orientation.z = oriented ? reading.orientation.z() : 0.0;
  for (std::size_t i = 0; i < 9; i += 4) {
    message.angular_velocity_covariance[i] = settings.gyro_noise * settings.gyro_noise * settings.rate_hz;
    message.linear_acceleration_covariance[i] =
        settings.accel_noise * settings.accel_noise * settings.rate_hz;
    message.orientation_covariance[i] = oriented ? 2.5e-5 : 0.0;
  }
  if (!oriented) message.orientation_covariance[0] = -1.0;
  return message;
}

nav_msgs::Odometry odometry_message(const sim::MotionState& state, Stamp stamp) {
  nav_msgs::Odometry message;
  message.header.stamp = ros_time(stamp);
  message.header.frame_id = "map";
  message.child_frame_id = "imu_link";
  const Eigen::Quaterniond q(state.T_map_imu.linear());
  const Eigen::Vector3d& t = state.T_map_imu.translation();
  const Eigen::Vector3d v_imu = state.T_map_imu.linear().transpose() * state.v_map;
  message.pose.pose.position.x = t.x();
  message.pose.pose.position.y = t.y();
  message.pose.pose.position.z = t.z();
  message.pose.pose.orientation.x = q.x();
  message.pose.pose.orientation.y = q.y();
  message.pose.pose.orientation.z = q.z();
  message.pose.pose.orientation.w = q.w();
  message.twist.twist.linear.x = v_imu.x();
  message.twist.twist.linear.y = v_imu.y();
  message.twist.twist.linear.z = v_imu.z();
  message.twist.twist.angular.x = state.w_imu.x();
  message.twist.twist.angular.y = state.w_imu.y();
  message.twist.twist.angular.z = state.w_imu.z();
  return message;
}

sensor_msgs::NavSatFix fix_message(const sim::GnssFix& fix, const sim::GnssSettings& settings) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  sensor_msgs::NavSatFix message;
  message.header.stamp = ros_time(add_seconds(kStart, fix.time_s));
  message.header.frame_id = "imu_link";
  message.status.status =
      fix.valid ? sensor_msgs::NavSatStatus::STATUS_FIX : sensor_msgs::NavSatStatus::STATUS_NO_FIX;
  message.status.service = sensor_msgs::NavSatStatus::SERVICE_GPS;
  message.latitude = fix.valid ? fix.latitude_deg : kNan;
  message.longitude = fix.valid ? fix.longitude_deg : kNan;
  message.altitude = fix.valid ? fix.altitude_m : kNan;
  const double variance = settings.noise_m * settings.noise_m + settings.drift_m * settings.drift_m;
  message.position_covariance[0] = message.position_covariance[4] = variance;
  message.position_covariance[8] = 9.0 * variance;
  message.position_covariance_type = sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN;
  return message;
}

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

/// Another drive along the way of `drive`: begins at rest where that is after `begin_s`, and goes on as that
/// does, or back, with the vehicle turned.
sim::Trajectory revisit(const sim::Trajectory& drive, double begin_s, bool reversed, double duration_s) {
  constexpr double kKnotPeriodS = 0.04;
  constexpr double kStandS = 2.0;
  constexpr double kRampS = 5.0;  // until it drives as fast as the first one did there
  std::vector<sim::PoseVector> poses;
  double yaw = 0.0;
  for (double t = 0.0; t < duration_s + 1.0; t += kKnotPeriodS) {
    // The integral of a speed that rises with 3 u^2 - 2 u^3.
    const double u = std::clamp((t - kStandS) / kRampS, 0.0, 1.0);
    const double passed_s = kRampS * (u * u * u - 0.5 * u * u * u * u) + std::max(0.0, t - kStandS - kRampS);
    Eigen::Isometry3d T = drive.pose(begin_s + (reversed ? -passed_s : passed_s));
    if (reversed) T.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
    const Eigen::Matrix3d R = T.rotation();
    const double wrapped_yaw = std::atan2(R(1, 0), R(0, 0));
    yaw = poses.empty() ? wrapped_yaw : yaw + std::remainder(wrapped_yaw - yaw, 2.0 * M_PI);
    sim::PoseVector pose;
    pose << T.translation(), std::atan2(R(2, 1), R(2, 2)), std::asin(-R(2, 0)), yaw;
    poses.push_back(pose);
  }
  return sim::Trajectory(std::move(poses), kKnotPeriodS);
}

/// The place with its first drive, which reaches as far as the one that is recorded.
sim::Place make_place(sim::Scenario scenario, const Options& options) {
  scenario.duration_s += options.revisit_s.value_or(0.0);
  return sim::make_place(scenario, options.seed);
}

/// The drive that is recorded: the first one (movers may follow it, so it stays where it is) or another.
std::unique_ptr<sim::Trajectory> choose_drive(sim::Trajectory first, const sim::Scenario& scenario,
                                              const Options& options) {
  if (!options.revisit_s) return std::make_unique<sim::Trajectory>(std::move(first));
  return std::make_unique<sim::Trajectory>(
      revisit(first, *options.revisit_s, options.reversed, scenario.duration_s));
}

/// Runs the sensors side by side and writes their messages in the order of their reception.
class Recorder {
 public:
  Recorder(const sim::Scenario& scenario, const Options& options, std::uint64_t noise_seed,
           const Files& files)
      : scenario_(scenario),
        place_(make_place(scenario, options)),
        drive_(choose_drive(*place_.trajectory, scenario, options)),
        model_(sim::make_lidar_model(scenario.lidar)),
        lidar_(*place_.world, *drive_, model_, sim::draw_lidar_errors(scenario, model_, noise_seed),
               scenario.world.dust_per_m, scenario.lidar, noise_seed),
        imu_(*drive_, scenario.imu, noise_seed),
        gnss_(*drive_, scenario.gnss, noise_seed),
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
    const Progress progress(scans);
    first_ = next_ = imu_.next();
    fix_ = gnss_.next();
    for (int begin = 0; begin < scans; begin += kBatch) {
      const int count = std::min(kBatch, scans - begin);
      std::vector<Scan> batch(static_cast<std::size_t>(count));
      fdi_lio::parallel_chunks(batch.size(), 1, [&](std::size_t i, std::size_t, std::size_t) {
        batch[i] = simulate(begin + static_cast<int>(i));
      });
      for (const Scan& scan : batch) write(scan);
      progress.update(begin + count);
    }
    bag_->close();
    tum_.close();
    labels_.close();
    sim::write_truth(files.working(".yaml"), scenario_, seed, place_.tunnel_begin_x_m, lidar_.errors(),
                     first_, next_);
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
    result.message = cloud_message(std::move(cloud), result.stamp, ouster ? "os_sensor" : "velodyne");
    return result;
  }

  void write(const Scan& scan) {
    write_until(scan.received_s);
    bag_->write("/points_raw", ros_time(add_seconds(kStart, scan.received_s)), scan.message);
    labels_.add(scan.stamp, scan.labels);
  }

  /// What the slower streams of messages have received before `time`, seconds.
  void write_until(double time) {
    for (;;) {
      const double imu = next_.time_s + kImuLatency;
      const double odometry = static_cast<double>(odometry_count_) / kOdometryRate;
      const double fix =
          scenario_.gnss.enabled ? fix_.time_s + kGnssLatency : std::numeric_limits<double>::max();
      const double first = std::min({imu, odometry, fix});
      if (first >= time) return;
      if (first == odometry) {
        write_odometry(odometry);
      } else if (first == imu) {
        write_imu();
      } else {
        bag_->write("/gps/fix", ros_time(add_seconds(kStart, fix)), fix_message(fix_, scenario_.gnss));
        fix_ = gnss_.next();
      }
    }
  }

  void write_odometry(double time) {
    const Stamp stamp = add_seconds(kStart, time);
    bag_->write("/ground_truth/odometry", ros_time(stamp), odometry_message(drive_->evaluate(time), stamp));
    ++odometry_count_;
  }

  void write_imu() {
    const Stamp received = add_seconds(kStart, next_.time_s + kImuLatency);
    bag_->write("/imu_raw", ros_time(received), imu_message(next_, scenario_.imu));
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
  sim::TumWriter tum_;
  sim::LabelWriter labels_;
  std::unique_ptr<rosbag::Bag> bag_ = std::make_unique<rosbag::Bag>();
  sim::ImuReading first_, next_;
  sim::GnssFix fix_;
  std::int64_t odometry_count_ = 0;
};

void run(int argc, char** argv) {
  const Options options = parse_arguments(argc, argv);
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
