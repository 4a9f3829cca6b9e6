#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/degeneracy/degeneracy_config.hpp"

namespace fdi_lio::degeneracy {

/// Moments of the sampled points in one voxel, relative to the first of them.
struct VoxelMoments {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  std::uint32_t count = 0;
  std::uint16_t ring_min = 0;
  std::uint16_t ring_max = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 6, 1> products = Eigen::Matrix<double, 6, 1>::Zero();  ///< xx xy xz yy yz zz

  Eigen::Vector3d mean_offset() const { return sum / count; }
  /// Covariance with divisor `count`.
  Eigen::Matrix3d covariance() const;
};

/// Shape of one voxel that holds enough points.
struct VoxelShape {
  std::uint32_t voxel = 0;
  Eigen::Vector3d eigenvalues = Eigen::Vector3d::Zero();  ///< ascending, not negative, m^2
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();      ///< axis of the smallest eigenvalue
};

/// Every `stride`-th point of a scan, sorted into voxels with one pass over a hash table.
/// Voxels double their edge with each octave of range, so that the points in one do not thin out with range.
/// Cost: O(samples) time and memory.
class VoxelStatistics {
 public:
  explicit VoxelStatistics(const DegeneracyConfig& config) : config_(config) {}

  /// Replaces the content. Points that are not finite are left out.
  void build(const DeskewedScan& scan);

  std::size_t stride() const { return stride_; }
  std::size_t sample_count() const { return sample_count_; }
  const std::vector<VoxelMoments>& voxels() const { return voxels_; }
  const std::vector<VoxelShape>& shapes() const { return shapes_; }
  /// Voxel of sample i, which is point i * stride(); kNoVoxel for a point that was left out.
  const std::vector<std::uint32_t>& voxel_of_sample() const { return voxel_of_sample_; }

  static constexpr std::uint32_t kNoVoxel = 0xFFFFFFFFU;

 private:
  std::uint64_t key_of(const Eigen::Vector3f& position) const;
  std::uint32_t find_or_add(std::uint64_t key, const Point& point);
  void compute_shapes(bool check_rings);

  DegeneracyConfig config_;
  std::size_t stride_ = 1;
  std::size_t sample_count_ = 0;
  std::vector<VoxelMoments> voxels_;
  std::vector<VoxelShape> shapes_;
  std::vector<std::uint32_t> voxel_of_sample_;
  std::vector<std::uint64_t> slot_keys_;
  std::vector<std::uint32_t> slot_voxels_;
};

}  // namespace fdi_lio::degeneracy
