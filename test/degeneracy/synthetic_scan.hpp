#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::degeneracy::test {

/// Beams of a spinning lidar.
struct Beams {
  int rings = 64;
  int columns = 1800;
  double elevation_min_deg = -24.9;
  double elevation_max_deg = 15.0;
  double max_range_m = 100.0;
  double noise_m = 0.02;
};

constexpr double kNoHit = std::numeric_limits<double>::infinity();

/// Range along the unit vector `d` to the inside of a box that is centred at the sensor.
struct BoxRoom {
  Eigen::Vector3d half{6.0, 4.0, 1.5};

  double operator()(const Eigen::Vector3d& d) const {
    double range = kNoHit;
    for (int axis = 0; axis < 3; ++axis)
      range = std::min(range, half[axis] / std::max(1e-12, std::abs(d[axis])));
    return range;
  }
};

/// Ground without anything on it.
struct EmptyPlane {
  double height_m = 1.8;

  double operator()(const Eigen::Vector3d& d) const { return d.z() < -1e-9 ? -height_m / d.z() : kNoHit; }
};

/// Ground with vertical posts of random width around the sensor.
class Posts {
 public:
  Posts(int count, double extent_m, double radius_m) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> place(-extent_m, extent_m);
    std::uniform_real_distribution<double> radius(0.5 * radius_m, 1.5 * radius_m);
    while (static_cast<int>(posts_.size()) < count) {
      const Eigen::Vector3d post(place(random), place(random), radius(random));
      if (post.head<2>().norm() > 2.0) posts_.push_back(post);
    }
  }

  double operator()(const Eigen::Vector3d& d) const {
    double range = EmptyPlane{}(d);
    const double a = d.head<2>().squaredNorm();
    for (const Eigen::Vector3d& post : posts_) {
      const double b = d.head<2>().dot(post.head<2>());
      const double discriminant = b * b - a * (post.head<2>().squaredNorm() - post.z() * post.z());
      if (b > 0.0 && discriminant > 0.0) range = std::min(range, (b - std::sqrt(discriminant)) / a);
    }
    return range;
  }

 private:
  std::vector<Eigen::Vector3d> posts_;
};

/// Scan of `surface`, ordered by ring and azimuth, with the same noise for the same arguments.
template <typename Surface>
DeskewedScan cast(const Surface& surface, const Beams& beams = {}) {
  DeskewedScan scan;
  scan.stamp = 1;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, beams.noise_m);
  scan.ring_begin.push_back(0);
  for (int ring = 0; ring < beams.rings; ++ring) {
    const double share = beams.rings > 1 ? static_cast<double>(ring) / (beams.rings - 1) : 0.5;
    const double elevation =
        (beams.elevation_min_deg + share * (beams.elevation_max_deg - beams.elevation_min_deg)) * M_PI /
        180.0;
    for (int column = 0; column < beams.columns; ++column) {
      const double azimuth = 2.0 * M_PI * column / beams.columns;
      const Eigen::Vector3d d(std::cos(elevation) * std::cos(azimuth),
                              std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const double range = surface(d);
      if (!(range < beams.max_range_m)) continue;
      Point point;
      point.position = ((range + noise(random)) * d).cast<float>();
      point.ring = static_cast<std::uint16_t>(ring);
      point.column = static_cast<std::uint16_t>(column);
      scan.points.push_back(point);
    }
    scan.ring_begin.push_back(static_cast<std::uint32_t>(scan.points.size()));
  }
  return scan;
}

/// Each beam ends at a random range: no surface at all.
inline DeskewedScan random_points(const Beams& beams = {}) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> range(2.0, 18.0);
  return cast([&](const Eigen::Vector3d&) { return range(random); }, beams);
}

}  // namespace fdi_lio::degeneracy::test
