#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <ros/serialization.h>
#include <sensor_msgs/PointCloud2.h>
#include <std_msgs/Header.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/point_cloud_reader.hpp"
#include "fdi_lio/scan/receive_clock.hpp"
#include "fdi_lio/scan/velodyne_packets.hpp"

namespace fdi_lio::ros_bridge {

/// Scans from messages of a lidar's topic, whatever their type: sensor_msgs/PointCloud2, or
/// velodyne_msgs/VelodyneScan, which is read from its bytes so that velodyne_msgs need not be installed.
class ScanReader {
 public:
  /// Names of the types that can be read.
  static const std::set<std::string>& types();

  ScanReader(const SensorConfig& sensor, Reporter* reporter);

  /// The scan of a message that knows its type and can write its bytes (rosbag::MessageInstance,
  /// topic_tools::ShapeShifter) and was received at `received`; nothing, and a report, when it holds none.
  /// `frame_id`, unless null, is set to the frame that the message names. Throws
  /// ros::serialization::StreamOverrunException for a message that is shorter than it says.
  template <typename Message>
  std::optional<Scan> read(const Message& message, const ros::Time& received,
                           std::string* frame_id = nullptr) {
    if (types().count(message.getDataType()) == 0) return refuse(message.getDataType());
    if (message.getDataType() == kPacketType) {
      buffer_.resize(message.size());
      ros::serialization::OStream out(buffer_.data(), message.size());
      message.write(out);
      return stamped(read_packets(frame_id), received);
    }
    const auto cloud = message.template instantiate<sensor_msgs::PointCloud2>();
    if (frame_id != nullptr) *frame_id = cloud->header.frame_id;
    return stamped(read_cloud(*cloud), received);
  }

 private:
  static constexpr const char* kPacketType = "velodyne_msgs/VelodyneScan";

  std::optional<Scan> refuse(const std::string& type);
  std::optional<Scan> read_cloud(const sensor_msgs::PointCloud2& cloud);
  std::optional<Scan> read_packets(std::string* frame_id);
  /// With the stamp that sensor.time_source asks for.
  std::optional<Scan> stamped(std::optional<Scan> scan, const ros::Time& received);

  SensorConfig sensor_;
  Reporter* reporter_;
  scan::ReceiveClock clock_;
  scan::PointCloudReader clouds_;
  scan::VelodynePacketReader packets_;
  std::vector<std::uint8_t> buffer_;  ///< the bytes of the newest message of packets
};

}  // namespace fdi_lio::ros_bridge
