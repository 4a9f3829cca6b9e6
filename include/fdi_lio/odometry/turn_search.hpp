#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/matching/voxel_map.hpp"

namespace fdi_lio::odometry {

/// By what a predicted attitude is off, after a gyro was wrong: the turn t with which the planes of a scan
/// (positions in the IMU frame) lie on those of the map, turned by R Exp(t), among turns of up to 45 degrees
/// about any axis. A point that finds its plane at the share s of all turns (near the axis, or in the middle
/// of many planes: s near 1) counts if s < 0.5: log(q / s) where it does, log((1 - q) / (1 - s)) where it
/// does not, with q = 0.7. Nothing unless the best turn has much more of that than none. It is known to about
/// a degree.
std::optional<Eigen::Vector3d> find_turn(const matching::VoxelMap& map,
                                         const std::vector<Eigen::Vector3d>& planes,
                                         const Eigen::Isometry3d& T_map_imu);

/// Features of a scan (lidar frame) deskewed by a gyro that missed `turn` (IMU frame) evenly over the
/// `duration_s` before the scan's stamp: Exp(turn t / duration) p in the IMU frame, t the time of the point.
FeatureSet turned_while_scanned(FeatureSet features, const Eigen::Vector3d& turn, double duration_s,
                                const Eigen::Isometry3d& T_imu_lidar);

}  // namespace fdi_lio::odometry
