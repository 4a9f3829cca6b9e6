#pragma once

#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/scan/deskew.hpp"

namespace fdi_lio::scan {

/// An axis-aligned box; seen from inside it is a room.
struct Box {
  Eigen::Vector3d lower;
  Eigen::Vector3d upper;
  bool is_moving = false;
};

/// Spinning lidar that sees boxes, without noise, all points at one instant.
struct SyntheticLidar {
  int rings = 32;
  int columns = 900;
  double lowest_deg = -20.0;
  double highest_deg = 12.0;

  Eigen::Vector3d direction(int ring, int column) const {
    const double elevation =
        (lowest_deg + (highest_deg - lowest_deg) * ring / std::max(1, rings - 1)) * M_PI / 180.0;
    const double azimuth = M_PI - 2.0 * M_PI * (column + 0.5) / columns;  // clockwise from behind
    return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
            std::sin(elevation)};
  }
};

/// A scan and which of its points lie on moving boxes.
struct LabelledScan {
  DeskewedScan scan;
  std::vector<bool> is_moving;
};

using Paint = std::function<double(const Eigen::Vector3d&)>;

/// First surface of `box` that the ray meets beyond 0.1 m; infinity without one.
inline double range_to(const Box& box, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  double enter = -std::numeric_limits<double>::infinity();
  double leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.lower[axis] - origin[axis]) / direction[axis];
    const double b = (box.upper[axis] - origin[axis]) / direction[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  constexpr double kNearest = 0.1;
  if (enter > leave) return std::numeric_limits<double>::infinity();
  if (enter > kNearest) return enter;
  return leave > kNearest ? leave : std::numeric_limits<double>::infinity();
}

/// Casts the rays of `lidar` from `T_odom_lidar`; the intensity is `paint` at the point in the odom frame.
inline LabelledScan cast(const SyntheticLidar& lidar, const std::vector<Box>& boxes,
                         const Eigen::Isometry3d& T_odom_lidar, Stamp stamp, const Paint& paint) {
  LabelledScan labelled;
  DeskewedScan& scan = labelled.scan;
  scan.stamp = stamp;
  scan.has_intensity = true;
  scan.ring_begin.push_back(0);
  for (int ring = 0; ring < lidar.rings; ++ring) {
    for (int column = 0; column < lidar.columns; ++column) {
      const Eigen::Vector3d ray = lidar.direction(ring, column);
      const Eigen::Vector3d direction = T_odom_lidar.linear() * ray;
      double range = std::numeric_limits<double>::infinity();
      bool is_moving = false;
      for (const Box& box : boxes) {
        const double distance = range_to(box, T_odom_lidar.translation(), direction);
        if (distance >= range) continue;
        range = distance;
        is_moving = box.is_moving;
      }
      if (!std::isfinite(range)) continue;
      Point point;
      point.position = (range * ray).cast<float>();
      point.ring = static_cast<std::uint16_t>(ring);
      point.intensity = static_cast<float>(paint(T_odom_lidar.translation() + range * direction));
      scan.points.push_back(point);
      labelled.is_moving.push_back(is_moving);
    }
    scan.ring_begin.push_back(static_cast<std::uint32_t>(scan.points.size()));
  }
  return labelled;
}

/// A hall of 40 m x 24 m x 8 m, its floor at z = 0, with two pillars and a table.
inline std::vector<Box> hall() {
  return {{{-20.0, -12.0, 0.0}, {20.0, 12.0, 8.0}},
          {{6.0, 5.0, 0.0}, {7.0, 6.0, 8.0}},
          {{-9.0, -4.0, 0.0}, {-8.2, -3.2, 8.0}},
          {{2.0, -9.0, 0.0}, {5.0, -7.0, 0.8}}};
}

/// Pose at (x, y), 1.8 m above the floor.
inline Eigen::Isometry3d pose_at(double x, double y, double yaw) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = Eigen::Vector3d(x, y, 1.8);
  T.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

/// Paint with structure from 0.2 m to some metres, always positive.
inline double marble(const Eigen::Vector3d& p) {
  return 40.0 * (1.0 + 0.4 * std::sin(1.3 * p.x() + 0.7 * p.z()) * std::cos(0.9 * p.y()) +
                 0.3 * std::sin(6.0 * p.x() + 4.0 * p.y() + 7.0 * p.z()));
}

}  // namespace fdi_lio::scan
