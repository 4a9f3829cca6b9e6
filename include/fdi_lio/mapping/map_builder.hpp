#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::mapping {

/// The map that is saved: keyframe clouds in `map`, one mean point a voxel.
class MapBuilder {
 public:
  /// The index makes room for `expected_voxels`.
  explicit MapBuilder(double voxel_m, std::size_t expected_voxels = 0);

  /// Adds the points of one keyframe, given in the lidar frame.
  void add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map_lidar);

  std::size_t size() const { return voxels_.size(); }

  /// One mean point a voxel, in `map`, in the order in which the voxels were first filled.
  std::vector<Point> points() const;

 private:
  struct Voxel {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();  ///< of offsets from the voxel's corner
    float intensity_sum = 0.0F;
    std::uint32_t count = 0;
    Eigen::Vector3i cell = Eigen::Vector3i::Zero();
  };

  Voxel* voxel_of(std::uint64_t key, const Eigen::Vector3i& cell);

  double voxel_m_;
  KeyIndex index_;
  std::deque<Voxel> voxels_;  ///< in the order in which they were first filled; grows without being copied
};

}  // namespace fdi_lio::mapping
