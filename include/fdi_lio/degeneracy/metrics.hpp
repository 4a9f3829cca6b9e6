#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/degeneracy/degeneracy_config.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"
#include "fdi_lio/degeneracy/voxel_statistics.hpp"

namespace fdi_lio::degeneracy {

/// Entropy of the eigenvalues over their sum, divided by ln 3: line 0, plane ln 2 / ln 3 = 0.631, ball 1; 0
/// for a point.
double eigenvalue_entropy(const Eigen::Vector3d& eigenvalues);

/// Mean eigenvalue entropy of the voxels with a shape, [0, 1]; 0 without any. Cost: O(voxels).
double local_shape_entropy(const VoxelStatistics& voxels);

/// Eigenvalue entropy of the mean n n^T of the voxels' normals n, each weighted by its planarity (l1 - l0) /
/// l2 with l0 <= l1 <= l2: one plane 0, two equal orthogonal planes or a tunnel 0.631, three 1; 0 without
/// any. Cost: O(voxels).
double orientation_entropy(const VoxelStatistics& voxels);

/// (1 - a) local_shape_entropy + a orientation_entropy with a = orientation_share, [0, 1]. Cost: O(voxels).
double geometric_complexity(const VoxelStatistics& voxels, const DegeneracyConfig& config);

/// Mean distance of the sampled points to the plane of their voxel, in metres, [0, voxel diagonal]; 0 without
/// any shape. Cost: O(samples).
double plane_deviation_m(const DeskewedScan& scan, const VoxelStatistics& voxels);

/// Entropy of the share of points in each occupied voxel over ln(max(occupied, entropy_reference_voxels)),
/// [0, 1]; 0 without points. Cost: O(voxels).
double point_entropy(const VoxelStatistics& voxels, const DegeneracyConfig& config);

/// Curvature of `middle` between two points of its ring: |left + right - 2 middle| less `noise_floor_m`, over
/// |left - middle| + |right - middle|. 0 is straight, 0.71 a right angle, 1 a spike.
float ring_curvature(const Eigen::Vector3f& left, const Eigen::Vector3f& middle, const Eigen::Vector3f& right,
                     float noise_floor_m);

/// Robust coefficient of variation of the curvature of every `stride`-th point: (q90 - q10) / (q50 +
/// curvature_floor), [0, 1 / curvature_floor]; 0 without any. Cost: O(points / stride).
double curvature_complexity(const DeskewedScan& scan, std::size_t stride, double range_noise_m,
                            const DegeneracyConfig& config);

/// Statistics of the intensity gradient of a scan.
struct GradientStatistics {
  bool valid = false;      ///< false: the scan has no intensity gradient, and the numbers say nothing
  double mean = 0.0;       ///< over the scan's robust maximum, [0, 1]
  double variation = 0.0;  ///< standard deviation over the mean
};

/// Cost: O(points / stride).
GradientStatistics gradient_statistics(const DeskewedScan& scan, std::size_t stride,
                                       const DegeneracyConfig& config);

}  // namespace fdi_lio::degeneracy
