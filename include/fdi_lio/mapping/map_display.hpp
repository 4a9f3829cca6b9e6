#pragma once

#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

/// The map as it is shown while it grows: the surfaces of all keyframes where the graph has them now, without
/// the ghosts that were found so far.
class MapDisplay {
 public:
  explicit MapDisplay(double voxel_m) : voxel_m_(voxel_m), settled_(voxel_m), newest_(voxel_m) {}

  /// Takes in the keyframes that came since the last call, and builds all of it anew when an optimisation has
  /// moved what a keyframe saw 20 m away by more than half a voxel. `global` is the same in each call. Throws
  /// Error when a cloud cannot be read back.
  void follow(const GlobalOptimizer& global);

  /// One mean point a voxel, in `map`; voxels of the newest keyframes, which may still be cleaned, come a
  /// second time.
  std::vector<Point> points() const;

 private:
  bool has_moved(const GlobalOptimizer& global) const;

  double voxel_m_;
  MapBuilder settled_;                     ///< keyframes that were cleaned
  std::vector<Eigen::Isometry3d> placed_;  ///< where they were when they were added: T_map_imu
  MapBuilder newest_;                      ///< the others
};

}  // namespace fdi_lio::mapping
