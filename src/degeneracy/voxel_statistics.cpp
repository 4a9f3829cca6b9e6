#include "fdi_lio/degeneracy/voxel_statistics.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace fdi_lio::degeneracy {

namespace {

constexpr int kCoordinateBits = 20;
constexpr int kMaxLevel = 7;
constexpr std::uint64_t kEmptySlot = 0;  // keys are never 0: their top bit is set

/// Smaller variances (a hundredth of a millimetre) are rounding: the points of such a voxel are equal.
constexpr double kLeastVariance_m2 = 1e-10;

std::uint64_t cell(float coordinate, float inverse_voxel) {
  constexpr auto kHalf = static_cast<float>(1 << (kCoordinateBits - 1));
  const float index = std::clamp(std::floor(coordinate * inverse_voxel), -kHalf, kHalf - 1.0F);
  return static_cast<std::uint64_t>(static_cast<std::int64_t>(index) + (1 << (kCoordinateBits - 1)));
}

std::size_t slot_of(std::uint64_t key, std::size_t mask) {
  const std::uint64_t mixed = key * 0x9E3779B97F4A7C15ULL;  // Fibonacci hashing
  return static_cast<std::size_t>(mixed >> 32U) & mask;
}

void add(const Point& point, VoxelMoments* voxel) {
  const Eigen::Vector3d d = (point.position - voxel->origin).cast<double>();
  ++voxel->count;
  voxel->sum += d;
  voxel->products[0] += d.x() * d.x();
  voxel->products[1] += d.x() * d.y();
  voxel->products[2] += d.x() * d.z();
  voxel->products[3] += d.y() * d.y();
  voxel->products[4] += d.y() * d.z();
  voxel->products[5] += d.z() * d.z();
  voxel->ring_min = std::min(voxel->ring_min, point.ring);
  voxel->ring_max = std::max(voxel->ring_max, point.ring);
}

}  // namespace

Eigen::Matrix3d VoxelMoments::covariance() const {
  const Eigen::Vector3d mean = mean_offset();
  Eigen::Matrix3d second;
  second << products[0], products[1], products[2], products[1], products[3], products[4], products[2],
      products[4], products[5];
  return second / count - mean * mean.transpose();
}

void VoxelStatistics::build(const DeskewedScan& scan) {
  const std::size_t limit = static_cast<std::size_t>(config_.max_samples);
  const std::size_t size = scan.points.size();
  stride_ = std::max<std::size_t>(1, (size + limit - 1) / limit);
  const std::size_t samples = (size + stride_ - 1) / stride_;
  std::size_t slots = 64;
  while (slots < 2 * samples) slots *= 2;
  slot_keys_.assign(slots, kEmptySlot);
  slot_voxels_.resize(slots);
  voxels_.clear();
  voxel_of_sample_.assign(samples, kNoVoxel);
  sample_count_ = 0;

  std::uint16_t ring_min = 0xFFFF;
  std::uint16_t ring_max = 0;
  for (std::size_t i = 0; i < samples; ++i) {
    const Point& point = scan.points[i * stride_];
    if (!point.position.allFinite()) continue;
    const std::uint32_t voxel = find_or_add(key_of(point.position), point);
    add(point, &voxels_[voxel]);
    voxel_of_sample_[i] = voxel;
    ++sample_count_;
    ring_min = std::min(ring_min, point.ring);
    ring_max = std::max(ring_max, point.ring);
  }
  compute_shapes(ring_max > ring_min);
}

std::uint64_t VoxelStatistics::key_of(const Eigen::Vector3f& position) const {
  const float range = position.norm();
  auto voxel = static_cast<float>(config_.voxel_m);
  auto border = static_cast<float>(config_.voxel_growth_range_m);
  std::uint64_t level = 0;
  while (level < kMaxLevel && range >= border) {
    voxel *= 2.0F;
    border *= 2.0F;
    ++level;
  }
  const float inverse = 1.0F / voxel;
  const std::uint64_t x = cell(position.x(), inverse);
  const std::uint64_t y = cell(position.y(), inverse);
  const std::uint64_t z = cell(position.z(), inverse);
  return (1ULL << 63U) | (level << 60U) | (x << 40U) | (y << 20U) | z;
}

std::uint32_t VoxelStatistics::find_or_add(std::uint64_t key, const Point& point) {
  const std::size_t mask = slot_keys_.size() - 1;
  std::size_t slot = slot_of(key, mask);
  while (slot_keys_[slot] != kEmptySlot) {
    if (slot_keys_[slot] == key) return slot_voxels_[slot];
    slot = (slot + 1) & mask;
  }
  slot_keys_[slot] = key;
  slot_voxels_[slot] = static_cast<std::uint32_t>(voxels_.size());
  VoxelMoments voxel;
  voxel.origin = point.position;
  voxel.ring_min = point.ring;
  voxel.ring_max = point.ring;
  voxels_.push_back(voxel);
  return slot_voxels_[slot];
}

void VoxelStatistics::compute_shapes(bool check_rings) {
  shapes_.clear();
  const auto least_points = static_cast<std::uint32_t>(config_.voxel_min_points);
  const int least_span = check_rings ? config_.voxel_min_ring_span : 0;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  for (std::uint32_t i = 0; i < voxels_.size(); ++i) {
    const VoxelMoments& voxel = voxels_[i];
    if (voxel.count < least_points || voxel.ring_max - voxel.ring_min < least_span) continue;
    VoxelShape shape;
    shape.voxel = i;
    const Eigen::Matrix3d covariance = voxel.covariance();
    if (covariance.trace() > kLeastVariance_m2) {
      solver.computeDirect(covariance);
      shape.eigenvalues = solver.eigenvalues().cwiseMax(0.0);
      shape.normal = solver.eigenvectors().col(0);
    }
    shapes_.push_back(shape);
  }
}

}  // namespace fdi_lio::degeneracy
