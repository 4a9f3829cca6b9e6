#include "bag_source.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include <rosbag/view.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/PointCloud2.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/scan/point_cloud_reader.hpp"

namespace fdi_lio::tools {

namespace {

const char* const kCloudType = "sensor_msgs/PointCloud2";
const char* const kPacketType = "velodyne_msgs/VelodyneScan";
const char* const kImuType = "sensor_msgs/Imu";

std::unique_ptr<rosbag::Bag> open_bag(const std::string& path) {
  if (!std::filesystem::exists(path)) throw Error("the bag " + path + " does not exist: check the path");
  auto bag = std::make_unique<rosbag::Bag>();
  try {
    bag->open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw Error("the bag " + path + " has no index (its recording was cut off): run `rosbag reindex " + path +
                "`");
  } catch (const rosbag::BagException& error) {
    throw Error("cannot read the bag " + path + " (" + error.what() +
                "): it may be truncated; try `rosbag reindex` or record it again");
  }
  return bag;
}

std::map<std::string, std::string> types_by_topic(rosbag::View* view) {
  std::map<std::string, std::string> types;
  for (const rosbag::ConnectionInfo* connection : view->getConnections())
    types[connection->topic] = connection->datatype;
  return types;
}

std::string topics_of_types(const std::map<std::string, std::string>& types,
                            const std::set<std::string>& wanted) {
  std::string text;
  for (const auto& [topic, type] : types) {
    if (wanted.count(type) != 0) text += (text.empty() ? "" : ", ") + topic;
  }
  return text.empty() ? "none" : text;
}

}  // namespace

BagSource::BagSource(const std::vector<std::string>& paths, const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter) {
  rosbag::View all;
  for (const std::string& path : paths) {
    bags_.push_back(open_bag(path));
    all.addQuery(*bags_.back());
  }
  const std::map<std::string, std::string> types = types_by_topic(&all);
  const auto lidar = types.find(sensor.points_topic);
  if (lidar == types.end() || (lidar->second != kCloudType && lidar->second != kPacketType)) {
    throw Error("the bag has no lidar messages on " + sensor.points_topic +
                "; topics of the right type: " + topics_of_types(types, {kCloudType, kPacketType}) +
                ". Choose one with --set sensor.points_topic=/TOPIC");
  }
  const auto imu = types.find(sensor.imu_topic);
  if (imu == types.end() || imu->second != kImuType) {
    reporter_->report(Severity::kWarning, "imu_topic",
                      "the bag has no IMU messages on '" + sensor.imu_topic +
                          "'; topics of the right type: " + topics_of_types(types, {kImuType}) +
                          ". Going on with the lidar alone");
  }
  if (all.size() > 0) total_s_ = (all.getEndTime() - all.getBeginTime()).toSec();
}

double BagSource::duration_s(double start_s, double duration_s) const {
  const double rest = std::max(0.0, total_s_ - start_s);
  return duration_s > 0.0 ? std::min(duration_s, rest) : rest;
}

void BagSource::read(double start_s, double duration_s, const BagCallbacks& callbacks) {
  rosbag::View all;
  for (const auto& bag : bags_) all.addQuery(*bag);
  const ros::Time origin = all.getBeginTime();
  const ros::Time begin = origin + ros::Duration(start_s);
  const ros::Time end = duration_s > 0.0 ? begin + ros::Duration(duration_s) : ros::TIME_MAX;
  rosbag::View view;
  const rosbag::TopicQuery topics(std::vector<std::string>{sensor_.points_topic, sensor_.imu_topic});
  for (const auto& bag : bags_) view.addQuery(*bag, topics, begin, end);
  scan::PointCloudReader reader(sensor_, reporter_);
  for (const rosbag::MessageInstance& message : view) {
    const auto started = std::chrono::steady_clock::now();
    if (message.getTopic() == sensor_.imu_topic) {
      if (const auto imu = message.instantiate<sensor_msgs::Imu>())
        callbacks.on_imu(ros_bridge::to_imu_sample(*imu));
    } else {
      std::optional<Scan> scan;
      if (const auto cloud = message.instantiate<sensor_msgs::PointCloud2>()) {
        scan = reader.read(ros_bridge::to_raw_cloud(*cloud));
      }
      callbacks.on_timing(
          "read",
          std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started).count());
      if (scan) callbacks.on_scan(std::move(*scan));
    }
    if (!callbacks.on_progress((message.getTime() - begin).toSec())) return;
  }
}

}  // namespace fdi_lio::tools
