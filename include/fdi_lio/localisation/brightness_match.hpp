#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/keyframe_store.hpp"

namespace fdi_lio::localisation {

/// How far the brightness of one place explains that of another, detail by detail.
struct BrightnessMatch {
  std::size_t voxels = 0;  ///< of the source that have a neighbour in the target
  /// Between ln(1 + intensity) of these voxels and of their neighbours, -1 to 1; 1 without contrast or
  /// voxels, since nothing disagrees then.
  double correlation = 1.0;
};

/// Compares the surfaces of `source`, moved by `T_target_source`, with those of `target`, both as one mean
/// point for each voxel of `voxel_m`. Each of the source's within `radius_m` of its origin is compared with
/// the nearest of the target's, if that is at most 1.25 voxels away. Equal doors have equal walls, but not
/// the same boards and tiles: such details are smaller than the cells that scans are matched to.
BrightnessMatch match_brightness(const std::vector<mapping::PlacedCloud>& target,
                                 const std::vector<mapping::PlacedCloud>& source,
                                 const Eigen::Isometry3d& T_target_source, double voxel_m, double radius_m);

}  // namespace fdi_lio::localisation
