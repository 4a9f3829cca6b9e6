#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

MapBuilder::MapBuilder(double voxel_m, std::size_t expected_voxels) : voxel_m_(voxel_m) {
  index_.reserve(expected_voxels);
}

MapBuilder::Voxel* MapBuilder::voxel_of(std::uint64_t key, const Eigen::Vector3i& cell) {
  const std::uint32_t number = index_.find_or_add(key);
  if (number == voxels_.size()) {
    voxels_.emplace_back();
    voxels_.back().cell = cell;
  }
  return &voxels_[number];
}

void MapBuilder::add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Matrix3d R = T_map_lidar.rotation();
  const Eigen::Vector3d t = T_map_lidar.translation();
  // Points come in the order of the beam: most fall into the voxel of the one before.
  std::uint64_t last_key = 0;
  Voxel* last = nullptr;
  for (const Point& point : points) {
    const Eigen::Vector3d p_map = R * point.position.cast<double>() + t;
    const Eigen::Vector3d scaled = p_map / voxel_m_;
    Eigen::Vector3i cell = scaled.cast<int>();  // std::floor is a call on the plainest x86-64
    for (int axis = 0; axis < 3; ++axis) cell[axis] -= scaled[axis] < cell[axis] ? 1 : 0;
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)
      key = (key << 21) | (static_cast<std::uint64_t>(cell[axis]) & 0x1fffff);
    if (last == nullptr || key != last_key) {
      last_key = key;
      last = voxel_of(key, cell);
    }
    last->sum += (p_map - voxel_m_ * cell.cast<double>()).cast<float>();
    last->intensity_sum += point.intensity;
    ++last->count;
  }
}

std::vector<Point> MapBuilder::points() const {
  std::vector<Point> points;
  points.reserve(voxels_.size());
  for (const Voxel& voxel : voxels_) {
    const float scale = 1.0F / static_cast<float>(voxel.count);
    Point point;
    point.position = (voxel_m_ * voxel.cell.cast<double>()).cast<float>() + scale * voxel.sum;
    point.intensity = scale * voxel.intensity_sum;
    points.push_back(point);
  }
  return points;
}

}  // namespace fdi_lio::mapping
