#pragma once

#include <optional>

#include <Eigen/Core>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::odometry {

/// Normal of the ground about the sensor, a unit vector in `odom`: of the plane within 20 m with the most
/// points on it among those tilted by up to 20 degrees. Nothing when it has less than 6 % of them, or when
/// more than a fifth of as many lie below it.
std::optional<Eigen::Vector3d> find_ground(const FeatureSet& features, const Eigen::Matrix3d& R_odom_lidar);

/// Whether the ground is tilted against `up` (unit vectors of the same axes) by more than 5 degrees, as
/// hardly a road is: then what says that `up` is upwards was misled, be it by gathering speed.
bool is_steep(const Eigen::Vector3d& ground_normal, const Eigen::Vector3d& up);

}  // namespace fdi_lio::odometry
