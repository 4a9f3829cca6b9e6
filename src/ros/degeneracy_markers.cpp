#include "fdi_lio/ros/degeneracy_markers.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fdi_lio/ros/message_conversions.hpp"

namespace fdi_lio::ros_bridge {

namespace {

using visualization_msgs::Marker;

constexpr double kWeak = 0.5;
constexpr double kArrowLength_m = 4.0;
constexpr double kRingRadius_m = 2.0;
constexpr double kLineWidth_m = 0.15;
constexpr double kTextHeight_m = 1.2;
constexpr double kTextAbove_m = 12.0;  ///< out of the points about the sensor
constexpr double kLifetime_s = 1.0;
constexpr int kRingSegments = 36;

geometry_msgs::Point to_point(const Eigen::Vector3d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}

/// The larger part of an axis, as a unit vector.
struct Direction {
  Eigen::Vector3d unit = Eigen::Vector3d::UnitX();
  bool is_rotation = false;
};

Direction direction_of(const Eigen::Matrix<double, 6, 1>& axis) {
  const Eigen::Vector3d rotation = axis.head<3>();
  const Eigen::Vector3d translation = axis.tail<3>();
  Direction direction;
  direction.is_rotation = rotation.norm() > translation.norm();
  const Eigen::Vector3d larger = direction.is_rotation ? rotation : translation;
  if (larger.norm() > 0.0) direction.unit = larger.normalized();
  return direction;
}

Marker empty_marker(const degeneracy::Degeneracy& degeneracy, const std::string& frame, const char* name,
                    int id) {
  Marker marker;
  marker.header.stamp = to_ros_time(degeneracy.stamp);
  marker.header.frame_id = frame;
  marker.ns = name;
  marker.id = id;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.lifetime = ros::Duration(kLifetime_s);
  marker.color.a = 1.0F;
  return marker;
}

std::string text_of(const degeneracy::Degeneracy& degeneracy) {
  static constexpr const char* kClasses[] = {"structured", "sparse", "dynamic", "mixed"};
  static constexpr const char* kSubFactors[] = {"structural", "sparse", "dynamic"};
  char line[128];
  std::snprintf(line, sizeof(line), "FDI %.2f  %s", degeneracy.fdi,
                kClasses[static_cast<int>(degeneracy.environment)]);
  std::string text = line;
  for (std::size_t k = 0; k < 3; ++k) {
    std::snprintf(line, sizeof(line), "\n%s %.2f  (weight %.2f)", kSubFactors[k], degeneracy.sub_factors[k],
                  degeneracy.weights[k]);
    text += line;
  }
  for (int k = 0; k < 6; ++k) {
    if (!(degeneracy.localizability[k] < kWeak)) continue;
    const Direction d = direction_of(degeneracy.axes.col(k));
    std::snprintf(line, sizeof(line), "\nweak %s (%.2f %.2f %.2f)  p %.2f", d.is_rotation ? "about" : "along",
                  d.unit.x(), d.unit.y(), d.unit.z(), degeneracy.localizability[k]);
    text += line;
  }
  return text;
}

void add_double_arrow(const Eigen::Vector3d& unit, Marker* marker) {
  const Eigen::Vector3d side = unit.unitOrthogonal();
  const auto line = [marker](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    marker->points.push_back(to_point(a));
    marker->points.push_back(to_point(b));
  };
  line(-kArrowLength_m * unit, kArrowLength_m * unit);
  for (const double end : {-1.0, 1.0}) {
    const Eigen::Vector3d tip = end * kArrowLength_m * unit;
    const Eigen::Vector3d back = 0.85 * tip;
    for (const double across : {-1.0, 1.0}) line(tip, back + across * 0.1 * kArrowLength_m * side);
  }
}

void add_ring(const Eigen::Vector3d& unit, Marker* marker) {
  const Eigen::Vector3d u = unit.unitOrthogonal();
  const Eigen::Vector3d v = unit.cross(u);
  for (int i = 0; i < kRingSegments; ++i) {
    for (const int k : {i, i + 1}) {
      const double angle = 2.0 * M_PI * k / kRingSegments;
      marker->points.push_back(to_point(kRingRadius_m * (std::cos(angle) * u + std::sin(angle) * v)));
    }
  }
}

}  // namespace

visualization_msgs::MarkerArray degeneracy_markers(const degeneracy::Degeneracy& degeneracy,
                                                   const std::string& imu_frame) {
  visualization_msgs::MarkerArray array;
  Marker text = empty_marker(degeneracy, imu_frame, "fdi", 0);
  text.type = Marker::TEXT_VIEW_FACING;
  text.pose.position.z = kTextAbove_m;
  text.scale.z = kTextHeight_m;
  text.color.r = static_cast<float>(std::min(1.0, 2.0 * degeneracy.fdi));
  text.color.g = static_cast<float>(std::min(1.0, 2.0 - 2.0 * degeneracy.fdi));
  text.color.b = 0.2F;
  text.text = text_of(degeneracy);
  array.markers.push_back(text);
  for (int k = 0; k < 6; ++k) {
    Marker marker = empty_marker(degeneracy, imu_frame, "weak_directions", k);
    marker.type = Marker::LINE_LIST;
    marker.scale.x = kLineWidth_m;
    if (degeneracy.localizability[k] < kWeak) {
      marker.color.r = 1.0F;
      marker.color.g = static_cast<float>(degeneracy.localizability[k] / kWeak);
      const Direction direction = direction_of(degeneracy.axes.col(k));
      if (direction.is_rotation) {
        add_ring(direction.unit, &marker);
      } else {
        add_double_arrow(direction.unit, &marker);
      }
    } else {
      marker.action = Marker::DELETE;
    }
    array.markers.push_back(marker);
  }
  return array;
}

}  // namespace fdi_lio::ros_bridge
