#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::matching {

/// Features in the body (IMU) frame, ready to be matched.
struct MatchInput {
  std::vector<Eigen::Vector3d> planes;
  std::vector<float> plane_factors;  ///< on the weight of each plane; empty: 1
  std::vector<Eigen::Vector3d> edges;
  std::vector<Eigen::Vector3d> textures;                 ///< intensity features
  std::vector<float> levels;                             ///< their comparable intensities J
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();      ///< of the lidar, in the body frame
  Eigen::Vector3d spin_axis = Eigen::Vector3d::UnitZ();  ///< of the lidar, in the body frame
};

/// Every k-th point, so that at most `limit` stay.
std::vector<Eigen::Vector3d> thin_out(const std::vector<Eigen::Vector3d>& points, std::size_t limit);

/// Features of a scan (lidar frame) thinned out for the matcher: the mean of the points in each voxel of
/// `feature_voxel_m` for planes, of half of it for edges, at most `mapping.max_planes_matched` planes, and
/// all intensity features. Edges and textures stay empty when `config` switches them off.
MatchInput make_match_input(const FeatureSet& features, const MappingConfig& config,
                            const Eigen::Isometry3d& T_imu_lidar, double feature_voxel_m);

}  // namespace fdi_lio::matching
