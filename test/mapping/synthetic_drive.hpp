#pragma once

#include <algorithm>
#include <vector>

#include "synthetic_places.hpp"

#include "fdi_lio/mapping/global_optimizer.hpp"

namespace fdi_lio::mapping {

/// Keyframes every 2 m round a square of 50 m, as often as wanted, with drifting odometry.
struct SyntheticDrive {
  SyntheticDrive(unsigned town_seed, double laps, double yaw_error_rad_per_m) {
    const SyntheticWorld town = make_town(town_seed);
    Eigen::Isometry3d T_odom = Eigen::Isometry3d::Identity();
    const int count = static_cast<int>(laps * 100.0);
    for (int k = 0; k < count; ++k) {
      const int side = k / 25 % 4;
      const Eigen::Isometry3d corner = planar_pose(25.0, -25.0, 0.5 * M_PI);
      const Eigen::Isometry3d T =
          planar_pose(0.0, 0.0, 0.5 * M_PI * side) * corner * planar_pose(2.0 * (k % 25), 0.0, 0.0);
      if (!truth.empty())
        T_odom = T_odom * truth.back().inverse() * T * planar_pose(0.0, 0.0, 2.0 * yaw_error_rad_per_m);
      truth.push_back(T);
      Keyframe keyframe;
      keyframe.stamp = 1000000000LL * k;
      keyframe.T_odom_imu = T_odom;
      keyframe.covariance = 1e-8 * Matrix6d::Identity();
      keyframe.cloud = town.seen_from(T, static_cast<unsigned>(k));
      keyframes.push_back(keyframe);
    }
  }

  /// How far the poses of the last keyframes are from where they were a lap before, beyond the truth.
  double worst_revisit(const GlobalOptimizer& global) const {
    double worst = 0.0;
    for (std::size_t k = 110; k < global.size(); ++k) {
      const Eigen::Isometry3d seen = global.T_map_imu(k - 100).inverse() * global.T_map_imu(k);
      worst = std::max(worst, seen.translation().norm());
    }
    return worst;
  }

  std::vector<Eigen::Isometry3d> truth;
  std::vector<Keyframe> keyframes;
};

}  // namespace fdi_lio::mapping
