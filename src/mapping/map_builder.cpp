#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

MapBuilder::MapBuilder(double voxel_m, std::size_t expected_voxels) : voxel_m_(voxel_m) {
  index_.reserve(expected_voxels);
}

std::uint64_t MapBuilder::key_of(const Eigen::Vector3i& cell) {
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis)
    key = (key << 21) | (static_cast<std::uint64_t>(cell[axis]) & 0x1fffff);
  return key;
}

MapBuilder::Voxel* MapBuilder::voxel_of(std::uint64_t key, const Eigen::Vector3i& cell) {
  const std::uint32_t number = index_.find_or_add(key);
  if (number == voxels_.size()) {
    voxels_.emplace_back();
    voxels_.back().cell = cell;
  }
  return &voxels_[number];
}

Point MapBuilder::mean_of(const Voxel& voxel) const {
  const float scale = 1.0F / static_cast<float>(voxel.count);
  Point point;
  point.position = (voxel_m_ * voxel.cell.cast<double>()).cast<float>() + scale * voxel.sum;
  point.intensity = scale * voxel.intensity_sum;
  return point;
}

std::vector<Point> MapBuilder::points() const {
  std::vector<Point> points;
  points.reserve(voxels_.size());
  for_each([&points](const Point& point) { points.push_back(point); });
  return points;
}

}  // namespace fdi_lio::mapping
