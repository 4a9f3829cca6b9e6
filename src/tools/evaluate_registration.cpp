#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "bag_options.hpp"
#include "bag_source.hpp"
#include "notice_log.hpp"
#include <Eigen/Eigenvalues>
#include <tbb/global_control.h>
#include <yaml-cpp/yaml.h>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/evaluation/trajectory_writer.hpp"
#include "fdi_lio/matching/local_map.hpp"
#include "fdi_lio/odometry/adaptation.hpp"
#include "fdi_lio/odometry/registration.hpp"
#include "fdi_lio/odometry/smoother.hpp"
#include "fdi_lio/pipeline/slam_pipeline.hpp"

namespace {

using fdi_lio::Error;
using fdi_lio::Stamp;
using fdi_lio::evaluation::StampedPose;

const char* const kUsage =
    "usage: evaluate_registration --config FILE --bag FILE.bag --output FILE.csv [--set key=value]...\n"
    "                             [--start S] [--duration S]\n"
    "Measures what the registration of a scan is worth by itself, on a recording of simulate_bag: the\n"
    "local map holds the earlier scans at their true poses, every fifth scan is put beside its own and\n"
    "registered, with and without its intensity features. No IMU and no other scan helps it. Reads\n"
    "FILE.tum (truth) and FILE.yaml (mounting and clocks are the true ones). Writes stamp [s], error and\n"
    "geometric_error [m], and the axis x,y,z (IMU frame) that the errors without intensity lie along.\n"
    "Exit code: 0 done, 2 not possible as asked (the message says why).\n";

/// Neighbours see the same.
constexpr int kScansBetween = 5;
/// How far beside its true pose a scan is put.
constexpr double kShiftM = 0.2;
constexpr double kTurnRad = 1.0 * M_PI / 180.0;

/// True poses of the IMU.
class Truth {
 public:
  explicit Truth(const std::string& path) {
    std::ifstream in(path);
    if (!in) throw Error("cannot read " + path + ": simulate_bag writes the truth beside its recording");
    for (std::string line; std::getline(in, line);) {
      if (line.empty() || line[0] == '#') continue;
      std::istringstream fields(line);
      double stamp_s = 0.0;
      Eigen::Vector3d t;
      Eigen::Quaterniond q;
      if (!(fields >> stamp_s >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w()))
        throw Error(path + ": not a line of the form 'stamp x y z qx qy qz qw': " + line);
      StampedPose pose;
      pose.stamp = fdi_lio::to_nanoseconds(stamp_s);
      pose.T.linear() = q.normalized().toRotationMatrix();
      pose.T.translation() = t;
      poses_.push_back(pose);
    }
    if (poses_.size() < 2) throw Error(path + ": holds fewer than two poses");
  }

  /// T_map_imu between the two poses around `stamp`; nothing outside.
  std::optional<Eigen::Isometry3d> at(Stamp stamp) const {
    const auto after = std::lower_bound(poses_.begin(), poses_.end(), stamp,
                                        [](const StampedPose& pose, Stamp s) { return pose.stamp < s; });
    if (after == poses_.begin() || after == poses_.end()) return std::nullopt;
    const StampedPose& a = *std::prev(after);
    const double part =
        fdi_lio::seconds_between(a.stamp, stamp) / fdi_lio::seconds_between(a.stamp, after->stamp);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(a.T.linear())
                     .slerp(part, Eigen::Quaterniond(after->T.linear()))
                     .toRotationMatrix();
    T.translation() = (1.0 - part) * a.T.translation() + part * after->T.translation();
    return T;
  }

 private:
  std::vector<StampedPose> poses_;
};

/// The parameters with the mounting and the clocks that are true: their errors are none of a scan's.
fdi_lio::Config with_true_calibration(fdi_lio::Config config, const std::string& path) {
  try {
    const YAML::Node truth = YAML::LoadFile(path);
    const auto t = truth["T_imu_lidar_true"]["translation"].as<std::vector<double>>();
    const auto q = truth["T_imu_lidar_true"]["rotation"].as<std::vector<double>>();
    config.sensor.t_imu_lidar = Eigen::Vector3d(t.at(0), t.at(1), t.at(2));
    config.sensor.q_imu_lidar = Eigen::Quaterniond(q.at(3), q.at(0), q.at(1), q.at(2));
    config.sensor.lidar_time_offset_s = -truth["lidar_clock_ahead_s"].as<double>();
  } catch (const std::exception& error) {
    throw Error("cannot read the true calibration from " + path + " (" + error.what() +
                "): simulate_bag writes it beside its recording");
  }
  // Nothing but a start is there to take over.
  config.mapping.soften_weak_directions = false;
  config.mapping.estimate_mounting = false;
  config.mapping.estimate_time_offset = false;
  config.mapping.estimate_gyro_scale = false;
  return config;
}

class Evaluation {
 public:
  Evaluation(const fdi_lio::Config& config, Truth truth, const std::string& path, fdi_lio::Reporter* reporter)
      : config_(config),
        truth_(std::move(truth)),
        T_imu_lidar_(config.sensor.T_imu_lidar()),
        registration_(config, reporter),
        map_(config.mapping),
        path_(path),
        out_(path) {
    if (!out_) throw Error("cannot write " + path);
    out_ << "stamp,error,geometric_error,x,y,z\n";
  }

  void add(const fdi_lio::pipeline::ScanOutput& output) {
    const auto T_map_imu = truth_.at(output.scan.stamp);
    if (!T_map_imu) return;
    if (++scans_ % kScansBetween == 0 && !map_.empty()) write(output, *T_map_imu);
    map_.insert(output.features, *T_map_imu, T_imu_lidar_);
  }

  void finish() {
    if (scans_ == 0) throw Error("no scan of the recording could be used: see the messages above");
    out_.close();
    if (!out_) throw Error("cannot write all of " + path_ + ": is the disk full?");
  }

 private:
  void write(const fdi_lio::pipeline::ScanOutput& output, const Eigen::Isometry3d& T_map_imu) {
    const auto adapted = fdi_lio::odometry::adapt(config_.adaptation, config_.mapping, output.degeneracy);
    auto input = fdi_lio::matching::make_match_input(output.features, config_.mapping, T_imu_lidar_,
                                                     adapted.feature_voxel_m);
    const Eigen::Matrix3d errors = square_errors(output.scan.stamp, input, adapted, T_map_imu);
    input.textures.clear();
    input.levels.clear();
    const Eigen::Matrix3d geometric = square_errors(output.scan.stamp, input, adapted, T_map_imu);
    const Eigen::Vector3d axis =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(geometric).eigenvectors().col(2);
    char line[128];
    std::snprintf(line, sizeof(line), "%.9f,%.6f,%.6f,%.6f,%.6f,%.6f\n",
                  fdi_lio::to_seconds(output.scan.stamp), std::sqrt(errors.trace()),
                  std::sqrt(geometric.trace()), axis.x(), axis.y(), axis.z());
    out_ << line;
  }

  /// Mean of e e' over three starts, each beside the truth along another axis, so that it does not matter how
  /// a weak direction lies to them; e is what is left of it, in the IMU frame [m^2].
  Eigen::Matrix3d square_errors(fdi_lio::Stamp stamp, const fdi_lio::matching::MatchInput& input,
                                const fdi_lio::odometry::AdaptedSettings& adapted,
                                const Eigen::Isometry3d& T_map_imu) {
    const Eigen::Quaterniond q(T_map_imu.linear());
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      fdi_lio::imu::NavState start;
      start.stamp = stamp;
      start.imu_status = fdi_lio::imu::ImuStatus::kInitialised;
      start.q_odom_imu = q * fdi_lio::so3::exp(Eigen::Vector3d(kTurnRad * Eigen::Vector3d::Unit(axis)));
      start.t_odom_imu = T_map_imu.translation() + q * (kShiftM * Eigen::Vector3d::Unit(axis));
      fdi_lio::odometry::Smoother smoother(1, config_.sensor.gravity_mps2, {}, 0.0);
      fdi_lio::odometry::Smoother::InitialSigma sigma;
      sigma.theta = kTurnRad;
      sigma.position = kShiftM;
      smoother.start(start, sigma);
      fdi_lio::odometry::Expectation expectation;
      expectation.is_unreliable = true;
      registration_.align(input, map_, adapted, 0, expectation, &smoother);
      const Eigen::Vector3d e = q.conjugate() * (smoother.newest().t_odom_imu - T_map_imu.translation());
      sum += e * e.transpose();
    }
    return sum / 3.0;
  }

  fdi_lio::Config config_;
  Truth truth_;
  Eigen::Isometry3d T_imu_lidar_;
  fdi_lio::odometry::Registration registration_;
  fdi_lio::matching::LocalMap map_;
  std::string path_;
  std::ofstream out_;
  int scans_ = 0;
};

int run(const fdi_lio::tools::BagOptions& options) {
  const std::string& bag = options.bags.at(0);
  const std::string stem = bag.substr(0, bag.rfind('.'));
  const fdi_lio::Config config =
      with_true_calibration(fdi_lio::load_config(options.config, options.overrides), stem + ".yaml");
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(config.threads));
  fdi_lio::Reporter reporter;
  Evaluation evaluation(config, Truth(stem + ".tum"), options.output, &reporter);
  fdi_lio::pipeline::SlamPipeline pipeline(
      config, &reporter,
      [&evaluation](const fdi_lio::pipeline::ScanOutput& output) { evaluation.add(output); },
      [](const std::string&, double) {});
  fdi_lio::tools::BagSource source(options.bags, config.sensor, &reporter);
  fdi_lio::tools::BagCallbacks callbacks;
  callbacks.on_imu = [&](const fdi_lio::imu::ImuSample& sample) { pipeline.add_imu(sample); };
  callbacks.on_scan = [&](fdi_lio::Scan scan) { pipeline.add_scan(std::move(scan)); };
  callbacks.on_timing = [](const std::string&, double) {};
  callbacks.on_progress = [&](double) {
    fdi_lio::tools::print_new(&reporter);
    return true;
  };
  source.read(options.start_s, options.duration_s, &reporter, callbacks);
  pipeline.finish();
  fdi_lio::tools::print_new(&reporter);
  evaluation.finish();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(fdi_lio::tools::parse_bag_options(argc, argv, kUsage, true));
  } catch (const std::exception& error) {
    std::cerr << "evaluate_registration: " << error.what() << "\n";
    return 2;
  }
}
