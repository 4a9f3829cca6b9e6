#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace fdi_lio {

/// The voxel that a place lies in; both in voxels.
inline Eigen::Vector3i cell_of(const Eigen::Vector3f& scaled) {
  Eigen::Vector3i cell = scaled.cast<int>();  // std::floor is a call on the plainest x86-64
  for (int axis = 0; axis < 3; ++axis) cell[axis] -= scaled[axis] < static_cast<float>(cell[axis]) ? 1 : 0;
  return cell;
}

/// One number for a voxel; 21 bits a coordinate.
inline std::uint64_t key_of(const Eigen::Vector3i& cell) {
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis)
    key = (key << 21) | (static_cast<std::uint64_t>(cell[axis]) & 0x1fffff);
  return key;
}

}  // namespace fdi_lio
