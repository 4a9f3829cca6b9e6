#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

/// The place in the index is asked for so many points before it is needed.
constexpr std::size_t kAhead = 16;

}  // namespace

void MapBuilder::add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map) {
  placed_.clear();
  for_each_cell(points, T_map, voxel_m_,
                [this](const Point& point, const Eigen::Vector3f& offset, const Eigen::Vector3i& cell) {
                  placed_.push_back({cell, offset, point.intensity});
                });
  add(placed_);
}

void MapBuilder::add(const std::vector<VoxelPoint>& points) {
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (k + kAhead < points.size()) index_.prefetch(key_of(points[k + kAhead].cell));
    add(points[k]);
  }
}

void MapBuilder::add(const VoxelPoint& point) {
  // Points come in the order of the beam: many fall into the voxel of the one before.
  if (index_.size() == 0 || point.cell != last_->cell) last_ = voxel_of(point.cell);
  last_->sum += point.offset;
  last_->intensity_sum += point.intensity;
  ++last_->count;
}

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
