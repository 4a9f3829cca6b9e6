#include "bag_source.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <rosbag/view.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/ros/scan_reader.hpp"

namespace fdi_lio::tools {

namespace {

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

std::vector<std::string> topics_of_types(const std::map<std::string, std::string>& types,
                                         const std::set<std::string>& wanted) {
  std::vector<std::string> topics;
  for (const auto& [topic, type] : types) {
    if (wanted.count(type) != 0) topics.push_back(topic);
  }
  return topics;
}

std::string joined(const std::vector<std::string>& topics) {
  std::string text;
  for (const std::string& topic : topics) text += (text.empty() ? "" : ", ") + topic;
  return text.empty() ? "none" : text;
}

/// `configured`, or the only topic that it can be when the recording does not have that. Throws Error when
/// there is none, or a choice.
std::string find_lidar(const std::map<std::string, std::string>& types, const std::string& configured,
                       Reporter* reporter) {
  const std::vector<std::string> fitting = topics_of_types(types, ros_bridge::ScanReader::types());
  if (std::count(fitting.begin(), fitting.end(), configured) > 0) return configured;
  if (fitting.size() != 1) {
    throw Error("the bag has no lidar messages on " + configured + "; topics of the right type: " +
                joined(fitting) + ". Choose one with --set sensor.points_topic=/TOPIC");
  }
  reporter->report(Severity::kWarning, "lidar_topic",
                   "the bag has no lidar messages on " + configured + ": taking " + fitting.front() +
                       ", the only topic of a fitting type (sensor.points_topic)");
  return fitting.front();
}

/// Gives one message to the callback it is for.
void hand_over(const rosbag::MessageInstance& message, const SensorConfig& sensor,
               ros_bridge::ScanReader* reader, const BagCallbacks& callbacks) {
  if (message.getTopic() == sensor.imu_topic) {
    if (const auto imu = message.instantiate<sensor_msgs::Imu>())
      callbacks.on_imu(ros_bridge::to_imu_sample(*imu));
    return;
  }
  if (message.getTopic() == sensor.gnss_topic) {
    if (const auto fix = message.instantiate<sensor_msgs::NavSatFix>())
      callbacks.on_fix(ros_bridge::to_gnss_fix(*fix));
    return;
  }
  const auto started = std::chrono::steady_clock::now();
  std::optional<Scan> scan = reader->read(message);
  callbacks.on_timing(
      "read", std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started).count());
  if (scan) callbacks.on_scan(std::move(*scan));
}

}  // namespace

BagSource::BagSource(const std::vector<std::string>& paths, const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor) {
  rosbag::View all;
  for (const std::string& path : paths) {
    bags_.push_back(open_bag(path));
    all.addQuery(*bags_.back());
  }
  const std::map<std::string, std::string> types = types_by_topic(&all);
  sensor_.points_topic = find_lidar(types, sensor.points_topic, reporter);
  const auto imu = types.find(sensor.imu_topic);
  if (imu == types.end() || imu->second != kImuType) {
    reporter->report(Severity::kWarning, "imu_topic",
                     "the bag has no IMU messages on '" + sensor.imu_topic + "'; topics of the right type: " +
                         joined(topics_of_types(types, {kImuType})) + ". Going on with the lidar alone");
  }
  if (all.size() > 0) total_s_ = (all.getEndTime() - all.getBeginTime()).toSec();
}

double BagSource::duration_s(double start_s, double duration_s) const {
  const double rest = std::max(0.0, total_s_ - start_s);
  return duration_s > 0.0 ? std::min(duration_s, rest) : rest;
}

std::vector<BagTopic> BagSource::topics() const {
  rosbag::View all;
  for (const auto& bag : bags_) all.addQuery(*bag);
  std::vector<BagTopic> topics;
  for (const auto& [name, type] : types_by_topic(&all)) {
    rosbag::View view;
    for (const auto& bag : bags_) view.addQuery(*bag, rosbag::TopicQuery(name));
    topics.push_back({name, type, view.size()});
  }
  return topics;
}

void BagSource::read(double start_s, double duration_s, Reporter* reporter, const BagCallbacks& callbacks) {
  rosbag::View all;
  for (const auto& bag : bags_) all.addQuery(*bag);
  const ros::Time origin = all.getBeginTime();
  const ros::Time begin = origin + ros::Duration(start_s);
  const ros::Time end = duration_s > 0.0 ? begin + ros::Duration(duration_s) : ros::TIME_MAX;
  rosbag::View view;
  std::vector<std::string> names = {sensor_.points_topic, sensor_.imu_topic};
  if (callbacks.on_fix) names.push_back(sensor_.gnss_topic);
  const rosbag::TopicQuery topics(names);
  for (const auto& bag : bags_) view.addQuery(*bag, topics, begin, end);
  ros_bridge::ScanReader reader(sensor_, reporter);
  try {
    for (const rosbag::MessageInstance& message : view) {
      try {
        hand_over(message, sensor_, &reader, callbacks);
      } catch (const ros::serialization::StreamOverrunException&) {
        reporter->report(Severity::kWarning, "message_damaged",
                         "a message on " + message.getTopic() + " was dropped: it is shorter than it says");
      }
      if (!callbacks.on_progress((message.getTime() - begin).toSec())) return;
    }
  } catch (const rosbag::BagException& error) {
    throw Error(std::string("the recording cannot be read to its end (") + error.what() +
                "): the file is damaged, copy it again, or keep what can be read with `rosbag filter`");
  }
}

}  // namespace fdi_lio::tools
