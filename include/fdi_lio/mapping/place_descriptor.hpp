#pragma once

#include <cstddef>
#include <deque>
#include <functional>
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
  using KeptGrid = Eigen::Array<Eigen::half, kRings, kSectors>;  ///< each keyframe has one, for good

  KeptGrid height = KeptGrid::Zero();     ///< highest point above the ground [m] plus an offset, 0: nothing
  KeptGrid intensity = KeptGrid::Zero();  ///< mean over the mean of its ring (no range effect) minus 1, in
                                          ///< [-1, 1]
  Eigen::Array<float, 2 * kRings, 1> ring_key =
      Eigen::Array<float, 2 * kRings, 1>::Zero();  ///< mean height and occupancy of each ring: no azimuth
};

/// Of keyframes. It grows without being copied, which for a long way would take its memory twice.
using Places = std::deque<PlaceDescriptor>;

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

/// A place that may be the one that is looked for.
struct AlikePlace {
  std::size_t index = 0;
  PlaceMatch match;
};

/// Which of `candidates` (indices in `places`) to look for.
struct AlikeSearch {
  double max_distance = 1.0;       ///< places that differ more are left out
  std::size_t limit = 1;           ///< most places that are returned
  std::size_t key_candidates = 1;  ///< so many with the nearest ring keys are compared column by column
  /// Whether two places are the same revisit, of which the more alike one is enough.
  std::function<bool(std::size_t, std::size_t)> is_same;
};

/// The places most like `query`, the best first.
std::vector<AlikePlace> most_alike(const Places& places, const std::vector<std::size_t>& candidates,
                                   const PlaceDescriptor& query, const AlikeSearch& search);

/// The rotation without its heading: level frame <- IMU, x of the level frame below x of the IMU.
Eigen::Matrix3d levelled(const Eigen::Matrix3d& R_odom_imu);

/// Rotation imu_a <- imu_b of two upright IMUs whose places look the same when b is turned by `yaw_rad`.
Eigen::Matrix3d rotation_between_places(const Eigen::Matrix3d& R_odom_imu_a, double yaw_rad,
                                        const Eigen::Matrix3d& R_odom_imu_b);

}  // namespace fdi_lio::mapping
