#pragma once

#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::scan {

/// Moves every point of `scan` to the lidar frame at `scan.stamp`:
///   p_lidar(ref) = T_imu_lidar^-1 T_odom_imu(ref)^-1 T_odom_imu(t) T_imu_lidar p_lidar(t)
/// with poses interpolated (slerp, linear) between `trajectory`, which must be in time order and reach to
/// `scan.stamp`. An empty trajectory or a scan without time leaves the points where they are. Gives how the
/// lidar moved meanwhile.
Sweep deskew(Scan* scan, const std::vector<imu::NavState>& trajectory, const Eigen::Isometry3d& T_imu_lidar);

/// Sorts the points ring by ring and by azimuth within a ring, in the direction of rotation from the start of
/// the sweep.
DeskewedScan order_by_ring(const Scan& scan);

}  // namespace fdi_lio::scan
