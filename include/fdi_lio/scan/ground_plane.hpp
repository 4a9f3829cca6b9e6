#pragma once

#include <vector>

#include <Eigen/Core>

namespace fdi_lio::scan {

/// The plane normal^T p + distance = 0 with the sensor at the origin on its positive side.
struct Plane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< towards the sensor, lidar frame
  double distance_m = 0.0;                            ///< of the sensor from the plane
  double share = 0.0;                                 ///< of the points that lie on it; 0: none was found
  double below = 0.0;                                 ///< of those more than 0.3 m behind it
};

/// The plane with the most of `points` (lidar frame, metres) on it among those whose normal lies within
/// `max_angle_rad` of the unit vector `axis`. Random samples of three points with a fixed seed: the same
/// points give the same plane.
Plane find_plane(const std::vector<Eigen::Vector3f>& points, const Eigen::Vector3d& axis,
                 double max_angle_rad);

}  // namespace fdi_lio::scan
