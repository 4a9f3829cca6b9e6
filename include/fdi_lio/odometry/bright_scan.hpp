#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::odometry {

constexpr float kBrightReachM = 40.0F;  ///< level distance of the points that are used

struct BrightPoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< from the sensor at `time_s`, level axes [m]
  float time_s = 0.0F;                                 ///< relative to the scan's stamp
  /// ln(1 + intensity) less its mean over the points of the same range, and of the same ring, that lie flat,
  /// or stand: what range and incidence do to the brightness of a road travels with the sensor.
  float detail = 0.0F;
  std::uint16_t ring = 0;
  bool stands = false;  ///< on another point or under one, rather than flat on the ground
};

/// Points of one scan in axes that do not turn with the sensor, the third at right angles to the ground.
struct BrightScan {
  Stamp stamp = 0;
  Eigen::Matrix3d R_level_lidar = Eigen::Matrix3d::Identity();
  /// Velocity and way that the accelerations since the first scan, where they are known, add to a velocity
  /// that stays the same (level axes).
  Eigen::Vector3d gained_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d gained_m = Eigen::Vector3d::Zero();
  std::vector<BrightPoint> points;
};

/// Takes the points out of features that were deskewed for rotation alone, or with the velocity `v_deskew`
/// (level axes) as well, which is undone.
BrightScan bright_scan(const FeatureSet& features, const Eigen::Matrix3d& R_level_lidar,
                       const Eigen::Vector3d& v_deskew);

/// Takes out of the details of several scans what stays in the same direction from the sensor: it says
/// nothing of its motion, but looks at rest beside it.
void subtract_fixed(std::vector<BrightScan>* scans);

}  // namespace fdi_lio::odometry
