#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::mapping {

/// What a place looks like from above, in the idea of Scan Context (Kim and Kim, IROS 2018): a polar grid
/// about the sensor, levelled by gravity. Rows are rings of distance, columns sectors of azimuth.
struct PlaceDescriptor {
  static constexpr int kRings = 20;
  static constexpr int kSectors = 60;
  using Grid = Eigen::Array<float, kRings, kSectors>;

  Grid height = Grid::Zero();     ///< highest point above the ground [m] plus an offset, 0 where nothing is
  Grid intensity = Grid::Zero();  ///< mean over the mean of its ring (no range effect) minus 1, in [-1, 1]
  Eigen::Array<float, 2 * kRings, 1> ring_key =
      Eigen::Array<float, 2 * kRings, 1>::Zero();  ///< mean height and occupancy of each ring: no azimuth
};

/// The descriptor of points in the IMU frame. `R_level_imu` turns them upright.
PlaceDescriptor describe_place(const std::vector<Point>& points, const Eigen::Matrix3d& R_level_imu,
                               double range_m);

struct PlaceMatch {
  double distance = 1.0;  ///< 0 equal, 1 nothing in common
  double yaw_rad = 0.0;   ///< of the second place's level frame in the first's, in [-pi, pi)
};

/// How alike two places are at the rotation that fits best.
PlaceMatch compare_places(const PlaceDescriptor& a, const PlaceDescriptor& b);

/// Distance of the rotation-invariant keys, for a first selection.
double ring_key_distance(const PlaceDescriptor& a, const PlaceDescriptor& b);

/// The rotation without its heading: level frame <- IMU, x of the level frame below x of the IMU.
Eigen::Matrix3d levelled(const Eigen::Matrix3d& R_odom_imu);

}  // namespace fdi_lio::mapping
