#include "bag_source.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <thread>
#include <utility>
#include <variant>

#include <nav_msgs/Odometry.h>
#include <rosbag/view.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>

#include "fdi_lio/common/bounded_queue.hpp"
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

/// Messages that are read ahead.
constexpr std::size_t kReadAhead = 64;

/// One message of the recording, decoded.
struct Decoded {
  double position_s = 0.0;  ///< receive time since the start
  std::variant<std::monostate, imu::ImuSample, mapping::GnssFix, mapping::ExternalPose, Scan> content;
  std::optional<double> read_ms;  ///< of a lidar message, which may be a part of a scan
};

Decoded decode(const rosbag::MessageInstance& message, const SensorConfig& sensor,
               ros_bridge::ScanReader* reader) {
  Decoded decoded;
  if (message.getTopic() == sensor.imu_topic) {
    if (const auto imu = message.instantiate<sensor_msgs::Imu>())
      decoded.content = ros_bridge::to_imu_sample(*imu);
    return decoded;
  }
  if (message.getTopic() == sensor.gnss_topic && message.isType<sensor_msgs::NavSatFix>()) {
    decoded.content = ros_bridge::to_gnss_fix(*message.instantiate<sensor_msgs::NavSatFix>());
    return decoded;
  }
  if (message.getTopic() == sensor.external_odometry_topic && message.isType<nav_msgs::Odometry>()) {
    decoded.content = ros_bridge::to_external_pose(*message.instantiate<nav_msgs::Odometry>());
    return decoded;
  }
  const auto started = std::chrono::steady_clock::now();
  if (std::optional<Scan> scan = reader->read(message, message.getTime())) decoded.content = std::move(*scan);
  decoded.read_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - started).count();
  return decoded;
}

/// Decodes the messages of `view` until its end, or until the queue is closed.
void decode_all(rosbag::View* view, const ros::Time& begin, const SensorConfig& sensor, Reporter* reporter,
                BoundedQueue<Decoded>* queue) {
  ros_bridge::ScanReader reader(sensor, reporter);
  try {
    for (const rosbag::MessageInstance& message : *view) {
      Decoded decoded;
      try {
        decoded = decode(message, sensor, &reader);
      } catch (const ros::serialization::StreamOverrunException&) {
        reporter->report(Severity::kWarning, "message_damaged",
                         "a message on " + message.getTopic() + " was dropped: it is shorter than it says");
      }
      decoded.position_s = (message.getTime() - begin).toSec();
      if (!queue->push(std::move(decoded))) return;
    }
  } catch (const rosbag::BagException& error) {
    throw Error(std::string("the recording cannot be read to its end (") + error.what() +
                "): the file is damaged, copy it again, or keep what can be read with `rosbag filter`");
  }
}

/// A thread that decodes messages ahead of their use.
class ReadAhead {
 public:
  ReadAhead(rosbag::View* view, const ros::Time& begin, const SensorConfig& sensor, Reporter* reporter)
      : queue_(kReadAhead), thread_([=, &sensor] {
          try {
            decode_all(view, begin, sensor, reporter, &queue_);
          } catch (...) {
            problem_ = std::current_exception();
          }
          queue_.close();
        }) {}
  ~ReadAhead() { join(); }
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// The next message; nothing at the end. Throws what ended the reading.
  std::optional<Decoded> next() {
    std::optional<Decoded> decoded = queue_.pop();
    if (decoded) return decoded;
    join();
    if (problem_) std::rethrow_exception(std::exchange(problem_, nullptr));
    return std::nullopt;
  }

 private:
  void join() {
    queue_.close();
    if (thread_.joinable()) thread_.join();
  }

  BoundedQueue<Decoded> queue_;
  std::exception_ptr problem_;
  std::thread thread_;  ///< last: it uses what is above
};

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
  const std::map<std::string, std::string> types = types_by_topic(&all);
  const auto add_optional = [&](const std::string& topic, const std::string& type, const std::string& what) {
    const auto found = types.find(topic);
    if (found != types.end() && found->second == type) {
      names.push_back(topic);
      return;
    }
    reporter->report(Severity::kWarning, "topic_missing " + what,
                     "the bag has no " + type + " on " + topic + ", the topic of " + what +
                         "; it has them on: " + joined(topics_of_types(types, {type})) +
                         ". Going on without");
  };
  if (callbacks.on_fix)
    add_optional(sensor_.gnss_topic, "sensor_msgs/NavSatFix", "GNSS fixes (sensor.gnss_topic)");
  if (callbacks.on_external)
    add_optional(sensor_.external_odometry_topic, "nav_msgs/Odometry",
                 "another odometry (sensor.external_odometry_topic)");
  const rosbag::TopicQuery topics(names);
  for (const auto& bag : bags_) view.addQuery(*bag, topics, begin, end);
  ReadAhead messages(&view, begin, sensor_, reporter);
  while (std::optional<Decoded> message = messages.next()) {
    if (message->read_ms) callbacks.on_timing("read", *message->read_ms);
    if (const auto* sample = std::get_if<imu::ImuSample>(&message->content)) callbacks.on_imu(*sample);
    if (const auto* fix = std::get_if<mapping::GnssFix>(&message->content)) callbacks.on_fix(*fix);
    if (const auto* pose = std::get_if<mapping::ExternalPose>(&message->content))
      callbacks.on_external(*pose);
    if (auto* scan = std::get_if<Scan>(&message->content)) callbacks.on_scan(std::move(*scan));
    if (!callbacks.on_progress(message->position_s)) return;
  }
}

}  // namespace fdi_lio::tools
