#pragma once

#include <Eigen/Core>

namespace fdi_lio::matching {

/// Where a point moves with the range [m/m] (first column) and the elevation [m/rad] (second) of its beam, in
/// any axes: `beam_m` is the point seen from the sensor, `spin_axis` the unit vector that elevations rise to.
/// Zero straight above and below, where the beam has no azimuth.
Eigen::Matrix<double, 3, 2> beam_motions(const Eigen::Vector3d& beam_m, const Eigen::Vector3d& spin_axis);

}  // namespace fdi_lio::matching
