#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "bag_options.hpp"
#include "bag_source.hpp"
#include "notice_log.hpp"
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>
#include <tbb/global_control.h>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/mapping/map_builder.hpp"
#include "fdi_lio/pipeline/slam_pipeline.hpp"
#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/scan/point_cloud_reader.hpp"

namespace {

using fdi_lio::Error;
using fdi_lio::Point;

const char* const kUsage =
    "usage: evaluate_moving_points --config FILE --bag FILE.bag [--set key=value]... [--start S] [--duration "
    "S]\n"
    "Runs a recording of simulate_bag through the system and compares the points that it removes as moving\n"
    "with the truth in FILE.labels. Prints JSON: shares of moving points removed and of static points kept\n"
    "(over all, and for each 10 m of range),\n"
    "of the map's voxels that only moving points filled (ghosts), in the scans and\n"
    "in the map as it is saved, and of the others that are saved.\n"
    "Exit code: 0 done, 2 not possible as asked (the message says why).\n";

/// The labels that simulate_bag writes beside a recording, scan by scan.
class LabelFile {
 public:
  explicit LabelFile(const std::string& path) : in_(path, std::ios::binary) {
    if (!in_)
      throw Error("cannot read " + path + ": labels are written by simulate_bag beside its recording");
  }

  std::vector<std::int16_t> next(std::uint64_t stamp_ns) {
    std::int64_t stamp = 0;
    std::uint32_t count = 0;
    std::vector<std::int16_t> labels;
    while (in_.read(reinterpret_cast<char*>(&stamp), sizeof(stamp)) &&
           in_.read(reinterpret_cast<char*>(&count), sizeof(count))) {
      labels.resize(count);
      in_.read(reinterpret_cast<char*>(labels.data()),
               static_cast<std::streamsize>(count * sizeof(std::int16_t)));
      if (in_ && static_cast<std::uint64_t>(stamp) == stamp_ns) return labels;
    }
    throw Error("the labels hold no scan of stamp " + std::to_string(stamp_ns));
  }

 private:
  std::ifstream in_;
};

/// A copy of the cloud whose intensities are the labels: the reader then drops the same points of both.
sensor_msgs::PointCloud2 with_labels(const sensor_msgs::PointCloud2& cloud,
                                     const std::vector<std::int16_t>& labels) {
  if (labels.size() != static_cast<std::size_t>(cloud.width) * cloud.height)
    throw Error("the labels do not fit the clouds of the recording");
  sensor_msgs::PointCloud2 copy = cloud;
  for (const sensor_msgs::PointField& field : cloud.fields) {
    if (field.name != "intensity" || field.datatype != sensor_msgs::PointField::FLOAT32) continue;
    for (std::size_t i = 0; i < labels.size(); ++i) {
      const auto label = static_cast<float>(labels[i]);
      std::memcpy(&copy.data[i * cloud.point_step + field.offset], &label, sizeof(label));
    }
  }
  return copy;
}

std::uint64_t key_of(const Point& point) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &point.time_s, sizeof(bits));
  return static_cast<std::uint64_t>(point.ring) << 32U | bits;
}

/// Counts over the recording.
class Score {
 public:
  Score(const fdi_lio::Config& config, fdi_lio::Reporter* reporter)
      : config_(config),
        keyframes_(config.sensor.T_imu_lidar(), voxel_m()),
        before_(voxel_m()),
        map_(config, reporter) {}

  void expect(fdi_lio::Stamp stamp, std::unordered_map<std::uint64_t, bool> is_moving) {
    expected_[stamp] = std::move(is_moving);
  }

  void add(fdi_lio::pipeline::ScanOutput output) {
    const auto entry = expected_.find(output.scan.stamp);
    if (entry == expected_.end()) return;
    const auto& is_moving = entry->second;
    for (Point& point : output.scan.points) {
      const bool moving = is_moving.at(key_of(point));
      ++(moving ? moving_kept_ : static_kept_);
      ++ring_of(point).of(moving).kept;
      point.intensity = moving ? kMoving : 0.0F;  // the keyframes' clouds then tell, in each voxel
    }
    for (std::size_t i = 0; i < output.scan.removed.size(); ++i) {
      const bool moving = is_moving.at(key_of(output.scan.removed[i]));
      ++(moving ? moving_removed_ : static_removed_);
      ++ring_of(output.scan.removed[i]).of(moving).removed;
      ++by_reason_[static_cast<int>(output.scan.removal_reasons[i])][moving ? 1 : 0];
    }
    expected_.erase(expected_.begin(), std::next(entry));
    if (!output.estimate.is_keyframe) return;
    fdi_lio::mapping::Keyframe keyframe = keyframes_.make(output.estimate, std::move(output.scan), {});
    before_.add(keyframe.cloud.surface, keyframe.T_odom_imu);
    map_.add(std::move(keyframe));
  }

  void print(std::ostream& out) {
    if (static_kept_ + static_removed_ + moving_kept_ + moving_removed_ == 0)
      throw Error("no scan of the recording could be used: see the messages above");
    const auto share = [](std::uint64_t part, std::uint64_t rest) {
      return part + rest > 0 ? static_cast<double>(part) / static_cast<double>(part + rest) : 1.0;
    };
    map_.finish();
    fdi_lio::mapping::MapBuilder after(voxel_m());
    for (std::size_t k = 0; k < map_.size(); ++k) after.add(map_.cloud(k)->surface, map_.T_odom_imu(k));
    const std::uint64_t ghosts = ghosts_of(after);
    const std::uint64_t ghosts_before = ghosts_of(before_);
    const std::uint64_t fixed = after.size() - ghosts;
    const std::uint64_t fixed_before = before_.size() - ghosts_before;
    out << "{\n  \"moving_points\": " << moving_removed_ + moving_kept_
        << ",\n  \"static_points\": " << static_removed_ + static_kept_
        << ",\n  \"moving_removed\": " << share(moving_removed_, moving_kept_)
        << ",\n  \"static_kept\": " << share(static_kept_, static_removed_)
        << ",\n  \"ghost_voxels_of_scans\": " << share(ghosts_before, fixed_before)
        << ",\n  \"ghost_voxels\": " << share(ghosts, fixed) << ",\n  \"static_voxels\": " << fixed
        << ",\n  \"static_voxels_kept\": " << share(fixed, fixed_before - std::min(fixed, fixed_before))
        << ",\n  \"reasons\": {";
    const char* separator = "";
    for (const auto& [reason, counts] : by_reason_) {
      out << separator << "\"" << reason << "\": {\"static\": " << counts[0] << ", \"moving\": " << counts[1]
          << "}";
      separator = ", ";
    }
    out << "},\n  \"by_range\": [";
    separator = "\n    ";
    for (const auto& [begin_m, counts] : by_range_) {
      const auto& [moving, fixed] = counts;
      out << separator << "{\"from_m\": " << begin_m
          << ", \"moving_points\": " << moving.kept + moving.removed
          << ", \"moving_removed\": " << share(moving.removed, moving.kept)
          << ", \"static_kept\": " << share(fixed.kept, fixed.removed) << "}";
      separator = ",\n    ";
    }
    out << "]\n}\n";
  }

 private:
  static constexpr float kMoving = 1.0F;

  struct Fate {
    std::uint64_t kept = 0, removed = 0;
  };
  struct Fates {
    Fate moving, fixed;
    Fate& of(bool is_moving) { return is_moving ? moving : fixed; }
  };

  Fates& ring_of(const Point& point) {
    constexpr int kWidth_m = 10;
    return by_range_[static_cast<int>(point.position.norm()) / kWidth_m * kWidth_m];
  }

  double voxel_m() const { return config_.mapping.output_map_voxel_m; }

  /// Voxels that only moving points filled.
  static std::uint64_t ghosts_of(const fdi_lio::mapping::MapBuilder& map) {
    const std::vector<Point> voxels = map.points();
    return static_cast<std::uint64_t>(std::count_if(
        voxels.begin(), voxels.end(), [](const Point& p) { return p.intensity > 0.999F * kMoving; }));
  }

  fdi_lio::Config config_;
  fdi_lio::mapping::KeyframeMaker keyframes_;
  fdi_lio::mapping::MapBuilder before_;    ///< of the scans as the filter left them
  fdi_lio::mapping::GlobalOptimizer map_;  ///< what is saved
  std::map<fdi_lio::Stamp, std::unordered_map<std::uint64_t, bool>> expected_;
  std::map<int, std::array<std::uint64_t, 2>> by_reason_;
  std::map<int, Fates> by_range_;  ///< by the range in metres where a ring begins
  std::uint64_t moving_kept_ = 0, moving_removed_ = 0, static_kept_ = 0, static_removed_ = 0;
};

int run(const fdi_lio::tools::BagOptions& options) {
  fdi_lio::Config config = fdi_lio::load_config(options.config, options.overrides);
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(config.threads));
  const std::string& path = options.bags.at(0);
  fdi_lio::Reporter reporter, quiet;
  config.sensor.points_topic =
      fdi_lio::tools::BagSource(options.bags, config.sensor, &reporter).points_topic();
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  LabelFile labels(path.substr(0, path.rfind('.')) + ".labels");
  fdi_lio::scan::PointCloudReader reader(config.sensor, &reporter);
  fdi_lio::scan::PointCloudReader label_reader(config.sensor, &quiet);
  config.loop.enabled = false;  // the voxels are those of the odometry
  Score score(config, &reporter);
  fdi_lio::pipeline::SlamPipeline pipeline(
      config, &reporter, [&score](fdi_lio::pipeline::ScanOutput output) { score.add(std::move(output)); },
      [](const std::string&, double) {});
  rosbag::View whole(bag);
  const ros::Time begin = whole.getBeginTime() + ros::Duration(options.start_s);
  const ros::Time end = options.duration_s > 0.0 ? begin + ros::Duration(options.duration_s) : ros::TIME_MAX;
  rosbag::View view(bag, rosbag::TopicQuery({config.sensor.points_topic, config.sensor.imu_topic}), begin,
                    end);
  for (const rosbag::MessageInstance& message : view) {
    if (const auto imu = message.instantiate<sensor_msgs::Imu>()) {
      pipeline.add_imu(fdi_lio::ros_bridge::to_imu_sample(*imu));
      continue;
    }
    const auto cloud = message.instantiate<sensor_msgs::PointCloud2>();
    if (!cloud) continue;
    auto scan = reader.read(fdi_lio::ros_bridge::to_raw_cloud(*cloud));
    const sensor_msgs::PointCloud2 labelled = with_labels(*cloud, labels.next(cloud->header.stamp.toNSec()));
    const auto truth = label_reader.read(fdi_lio::ros_bridge::to_raw_cloud(labelled));
    if (!scan || !truth) continue;
    std::unordered_map<std::uint64_t, bool> is_moving;
    for (const Point& point : truth->points) is_moving[key_of(point)] = point.intensity > 0.0F;
    score.expect(scan->stamp, std::move(is_moving));
    pipeline.add_scan(std::move(*scan));
  }
  pipeline.finish();
  fdi_lio::tools::print_new(&reporter);
  score.print(std::cout);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(fdi_lio::tools::parse_bag_options(argc, argv, kUsage, false));
  } catch (const std::exception& error) {
    std::cerr << "evaluate_moving_points: " << error.what() << "\n";
    return 2;
  }
}
