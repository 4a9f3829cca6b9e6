#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

MapBuilder::Voxel* MapBuilder::voxel_of(const Eigen::Vector3i& cell) {
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis)
    key = (key << 21) | (static_cast<std::uint64_t>(cell[axis]) & 0x1fffff);
  const std::size_t known = index_.size();
  const std::uint32_t number = index_.find_or_add(key);
  if (number / kBlock == blocks_.size()) blocks_.emplace_back(kBlock);
  Voxel& voxel = blocks_[number / kBlock][number % kBlock];
  if (number == known) {
    voxel = Voxel();
    voxel.cell = cell;
  }
  return &voxel;
}

Point MapBuilder::mean_of(const Voxel& voxel) const {
  const float scale = 1.0F / static_cast<float>(voxel.count);
  Point point;
  point.position =
      (voxel_m_ * (voxel.cell.cast<double>() + (scale * voxel.sum).cast<double>())).cast<float>();
  point.intensity = scale * voxel.intensity_sum;
  return point;
}

std::vector<Point> MapBuilder::points() const {
  std::vector<Point> points;
  points.reserve(size());
  for_each([&points](const Point& point) { points.push_back(point); });
  return points;
}

}  // namespace fdi_lio::mapping
