#pragma once

#include <array>
#include <cstdint>

#include <Eigen/Core>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::degeneracy {

enum class EnvironmentClass : std::uint8_t { kStructured = 0, kSparse = 1, kDynamic = 2, kMixed = 3 };

/// The four metrics of one scan, and what scan processing and mapping know besides.
struct Metrics {
  double geometric_complexity =
      0.0;  ///< eigenvalue entropy of voxel covariances and of their normals, [0, 1]
  double curvature_complexity =
      0.0;                     ///< robust coefficient of variation of the curvature, [0, 1 / curvature_floor]
  double point_entropy = 0.0;  ///< entropy of the voxel occupancy over its reference maximum, [0, 1]
  double plane_deviation_m = 0.0;   ///< mean distance to planes fitted in voxels
  bool has_gradient = false;        ///< false: the scan has no intensity gradient, the next two say nothing
  double gradient_mean = 0.0;       ///< mean intensity gradient over the scan's robust maximum, [0, 1]
  double gradient_variation = 0.0;  ///< coefficient of variation of the intensity gradient
  std::uint32_t points = 0;         ///< of the scan, those removed as moving included
  bool has_moving_share = false;    ///< false: moving points are not looked for, the next one says nothing
  double moving_share = 0.0;        ///< share of the points that earlier scans prove to be moving, [0, 1]
  double position_sigma_m = 0.0;    ///< of the weakest direction of the scan before, by mapping; 0: unknown
};

/// How degraded the surroundings of one scan are. The defaults are the neutral value.
struct Degeneracy {
  Stamp stamp = 0;
  double fdi = 0.0;                                  ///< [0, 1], larger is worse
  std::array<double, 3> sub_factors{0.0, 0.0, 0.0};  ///< structural, sparse, dynamic, each [0, 1]
  std::array<double, 3> weights{1.0 / 3, 1.0 / 3, 1.0 / 3};
  Metrics metrics;
  EnvironmentClass environment = EnvironmentClass::kStructured;
  /// Directions of the last optimisation in [dtheta, dt] of the IMU frame, columns are axes, strongest first.
  Eigen::Matrix<double, 6, 6> axes = Eigen::Matrix<double, 6, 6>::Identity();
  /// Probability that each axis is observed by the lidar.
  Eigen::Matrix<double, 6, 1> localizability = Eigen::Matrix<double, 6, 1>::Ones();
};

}  // namespace fdi_lio::degeneracy
