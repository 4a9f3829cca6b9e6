#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

MapBuilder::Voxel* MapBuilder::voxel_of(const Eigen::Vector3i& cell) {
  const std::size_t known = index_.size();
  const std::uint32_t number = index_.find_or_add(key_of(cell));
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
