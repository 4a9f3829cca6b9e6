#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/matching/voxel_map.hpp"

namespace fdi_lio::matching {

/// What the estimator knows of the surroundings in `odom`: one voxel map for each class of features, within
/// `mapping.map_radius` of the newest pose.
class LocalMap {
 public:
  explicit LocalMap(const MappingConfig& config);

  /// Adds the features of a scan (lidar frame) taken at `T_odom_imu`. A scan from a pose that hardly differs
  /// from the last one's is left out: standing still, the beams hit the same spots again and again, and cells
  /// would fill up knowing nothing but these. The first scans always enter.
  void insert(const FeatureSet& features, const Eigen::Isometry3d& T_odom_imu,
              const Eigen::Isometry3d& T_imu_lidar);

  const VoxelMap& planes() const { return planes_; }
  const VoxelMap& edges() const { return edges_; }
  const VoxelMap& textures() const { return textures_; }

  bool empty() const { return planes_.empty(); }
  std::size_t cell_count() const { return planes_.cell_count() + edges_.cell_count(); }

  /// Means of the filled voxels of planes and edges, in odom.
  std::vector<Point> points() const;

 private:
  bool has_moved_on(const Eigen::Isometry3d& T_odom_imu) const;

  MappingConfig config_;
  VoxelMap planes_;
  VoxelMap edges_;
  VoxelMap textures_;
  int inserted_ = 0;
  Eigen::Isometry3d T_odom_inserted_ = Eigen::Isometry3d::Identity();
  Eigen::Vector3d trimmed_at_ = Eigen::Vector3d::Zero();
};

}  // namespace fdi_lio::matching
