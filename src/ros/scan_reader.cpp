#include "fdi_lio/ros/scan_reader.hpp"

#include "fdi_lio/ros/conversions.hpp"

namespace fdi_lio::ros_bridge {

const std::set<std::string>& ScanReader::types() {
  static const std::set<std::string> types{"sensor_msgs/PointCloud2", kPacketType};
  return types;
}

ScanReader::ScanReader(const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter), clouds_(sensor, reporter), packets_(sensor, reporter) {}

std::optional<Scan> ScanReader::refuse(const std::string& type) {
  reporter_->report(Severity::kError, "lidar_type",
                    "the lidar's topic has messages of type " + type +
                        ", readable are sensor_msgs/PointCloud2 and velodyne_msgs/VelodyneScan: check "
                        "sensor.points_topic");
  return std::nullopt;
}

std::optional<Scan> ScanReader::read_cloud(const sensor_msgs::PointCloud2& cloud) {
  return clouds_.read(to_raw_cloud(cloud));
}

std::optional<Scan> ScanReader::read_packets(std::string* frame_id) {
  const auto packets = scan::split_velodyne_scan(buffer_.data(), buffer_.size());
  if (!packets) {
    reporter_->report(Severity::kWarning, "packet_message",
                      "a message of type velodyne_msgs/VelodyneScan was dropped: its size does not fit its "
                      "number of packets");
    return std::nullopt;
  }
  if (frame_id != nullptr) {
    ros::serialization::IStream in(buffer_.data(), static_cast<std::uint32_t>(buffer_.size()));
    std_msgs::Header header;
    ros::serialization::deserialize(in, header);
    *frame_id = header.frame_id;
  }
  return packets_.read(*packets);
}

std::optional<Scan> ScanReader::stamped(std::optional<Scan> scan, const ros::Time& received) {
  if (!scan || sensor_.time_source != "receive") return scan;
  const double offset_s = sensor_.lidar_time_offset_s;
  const Stamp own = add_seconds(scan->stamp, -offset_s);
  scan->stamp = add_seconds(clock_.to_received(own, static_cast<Stamp>(received.toNSec())), offset_s);
  return scan;
}

}  // namespace fdi_lio::ros_bridge
