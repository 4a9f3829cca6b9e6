#include <cstring>

#include <boost/make_shared.hpp>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/ros/message_conversions.hpp"

namespace fdi_lio::ros_bridge {

namespace {

/// One point as it lies in the cloud.
struct PackedPoint {
  float x, y, z, intensity, time;
  std::uint16_t ring, column;
};
static_assert(sizeof(PackedPoint) == 24, "the fields of to_cloud describe 24 bytes");

sensor_msgs::PointField field(const char* name, std::uint32_t offset, std::uint8_t datatype) {
  sensor_msgs::PointField result;
  result.name = name;
  result.offset = offset;
  result.datatype = datatype;
  result.count = 1;
  return result;
}

std::vector<sensor_msgs::PointField> packed_fields() {
  using sensor_msgs::PointField;
  return {field("x", 0, PointField::FLOAT32),     field("y", 4, PointField::FLOAT32),
          field("z", 8, PointField::FLOAT32),     field("intensity", 12, PointField::FLOAT32),
          field("time", 16, PointField::FLOAT32), field("ring", 20, PointField::UINT16),
          field("column", 22, PointField::UINT16)};
}

void check_length(const char* what, std::size_t length, std::size_t points) {
  if (length != 0 && length != points) {
    throw Error(std::string("a message has ") + std::to_string(length) + " values of " + what + " for " +
                std::to_string(points) + " points: are all nodes of the same version?");
  }
}

}  // namespace

sensor_msgs::PointCloud2 to_cloud(const std::vector<Point>& points, Stamp stamp,
                                  const std::string& frame_id) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = to_ros_time(stamp);
  cloud.header.frame_id = frame_id;
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(points.size());
  cloud.fields = packed_fields();
  cloud.point_step = sizeof(PackedPoint);
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.is_dense = true;
  cloud.data.resize(cloud.row_step);
  std::uint8_t* at = cloud.data.data();
  for (const Point& point : points) {
    const PackedPoint packed{point.position.x(), point.position.y(), point.position.z(), point.intensity,
                             point.time_s,       point.ring,         point.column};
    std::memcpy(at, &packed, sizeof(packed));
    at += sizeof(packed);
  }
  return cloud;
}

std::vector<Point> to_points(const sensor_msgs::PointCloud2& cloud) {
  const std::size_t count = static_cast<std::size_t>(cloud.width) * cloud.height;
  if (cloud.point_step != sizeof(PackedPoint) || cloud.data.size() != count * sizeof(PackedPoint) ||
      cloud.fields.size() != packed_fields().size()) {
    throw Error("a cloud between the nodes has a foreign layout: are all nodes of the same version?");
  }
  std::vector<Point> points(count);
  const std::uint8_t* at = cloud.data.data();
  for (Point& point : points) {
    PackedPoint packed;
    std::memcpy(&packed, at, sizeof(packed));
    at += sizeof(packed);
    point.position << packed.x, packed.y, packed.z;
    point.intensity = packed.intensity;
    point.time_s = packed.time;
    point.ring = packed.ring;
    point.column = packed.column;
  }
  return points;
}

DeskewedCloudPtr to_message(const DeskewedScan& scan, const std::string& lidar_frame) {
  auto message = boost::make_shared<DeskewedCloud>();
  message->header.stamp = to_ros_time(scan.stamp);
  message->header.frame_id = lidar_frame;
  message->duration = scan.duration_s;
  message->has_intensity = scan.has_intensity;
  Eigen::Map<Eigen::Vector3f>(message->sweep_start.data()) = scan.sweep.start;
  for (std::size_t k = 0; k < scan.sweep.axes.size(); ++k)
    Eigen::Map<Eigen::Vector3f>(message->sweep_axes.data() + 3 * k) = scan.sweep.axes[k];
  message->ring_begin = scan.ring_begin;
  message->points = to_cloud(scan.points, scan.stamp, lidar_frame);
  message->intensity_level = scan.intensity_level;
  message->intensity_gradient = scan.intensity_gradient;
  message->gradient_stability = scan.gradient_stability;
  message->removed = to_cloud(scan.removed, scan.stamp, lidar_frame);
  for (const RemovalReason reason : scan.removal_reasons)
    message->removal_reasons.push_back(static_cast<std::uint8_t>(reason));
  return message;
}

DeskewedScan to_scan(const DeskewedCloud& message) {
  DeskewedScan scan;
  scan.stamp = to_stamp(message.header.stamp);
  scan.duration_s = message.duration;
  scan.has_intensity = message.has_intensity != 0;
  scan.sweep.start = Eigen::Map<const Eigen::Vector3f>(message.sweep_start.data());
  for (std::size_t k = 0; k < scan.sweep.axes.size(); ++k)
    scan.sweep.axes[k] = Eigen::Map<const Eigen::Vector3f>(message.sweep_axes.data() + 3 * k);
  scan.points = to_points(message.points);
  scan.ring_begin = message.ring_begin;
  if (!scan.ring_begin.empty() && scan.ring_begin.back() != scan.points.size())
    throw Error("the rings of a deskewed scan do not cover its points: are all nodes of the same version?");
  scan.intensity_level = message.intensity_level;
  scan.intensity_gradient = message.intensity_gradient;
  scan.gradient_stability = message.gradient_stability;
  check_length("intensity_level", scan.intensity_level.size(), scan.points.size());
  check_length("intensity_gradient", scan.intensity_gradient.size(), scan.points.size());
  check_length("gradient_stability", scan.gradient_stability.size(), scan.points.size());
  scan.removed = to_points(message.removed);
  for (const std::uint8_t reason : message.removal_reasons)
    scan.removal_reasons.push_back(static_cast<RemovalReason>(reason));
  check_length("removal_reasons", scan.removal_reasons.size(), scan.removed.size());
  return scan;
}

FeaturesPtr to_message(const FeatureSet& features, const std::string& lidar_frame) {
  auto message = boost::make_shared<Features>();
  message->header.stamp = to_ros_time(features.stamp);
  message->header.frame_id = lidar_frame;
  message->planes = to_cloud(features.planes, features.stamp, lidar_frame);
  message->edges = to_cloud(features.edges, features.stamp, lidar_frame);
  message->intensity_edges = to_cloud(features.intensity_edges, features.stamp, lidar_frame);
  message->plane_scores = features.plane_scores;
  message->edge_scores = features.edge_scores;
  message->intensity_scores = features.intensity_scores;
  return message;
}

FeatureSet to_features(const Features& message) {
  FeatureSet features;
  features.stamp = to_stamp(message.header.stamp);
  features.planes = to_points(message.planes);
  features.edges = to_points(message.edges);
  features.intensity_edges = to_points(message.intensity_edges);
  features.plane_scores = message.plane_scores;
  features.edge_scores = message.edge_scores;
  features.intensity_scores = message.intensity_scores;
  check_length("plane_scores", features.plane_scores.size(), features.planes.size());
  check_length("edge_scores", features.edge_scores.size(), features.edges.size());
  check_length("intensity_scores", features.intensity_scores.size(), features.intensity_edges.size());
  return features;
}

}  // namespace fdi_lio::ros_bridge
