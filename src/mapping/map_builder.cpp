#include "fdi_lio/mapping/map_builder.hpp"

#include <cmath>

namespace fdi_lio::mapping {

MapBuilder::MapBuilder(double voxel_m) : voxel_m_(voxel_m) {}

void MapBuilder::add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Matrix3d R = T_map_lidar.rotation();
  const Eigen::Vector3d t = T_map_lidar.translation();
  for (const Point& point : points) {
    const Eigen::Vector3d p_map = R * point.position.cast<double>() + t;
    const Eigen::Vector3i cell = (p_map / voxel_m_).array().floor().cast<int>();
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)
      key = (key << 21) | (static_cast<std::uint64_t>(cell[axis]) & 0x1fffff);
    Voxel& voxel = voxels_[key];
    if (voxel.count == 0) {
      voxel.order = static_cast<std::uint32_t>(voxels_.size() - 1);
      voxel.cell = cell;
    }
    voxel.sum += (p_map - voxel_m_ * cell.cast<double>()).cast<float>();
    voxel.intensity_sum += point.intensity;
    ++voxel.count;
  }
}

std::vector<Point> MapBuilder::points() const {
  std::vector<Point> points(voxels_.size());
  for (const auto& entry : voxels_) {
    const Voxel& voxel = entry.second;
    const float scale = 1.0F / static_cast<float>(voxel.count);
    Point& point = points[voxel.order];
    point.position = (voxel_m_ * voxel.cell.cast<double>()).cast<float>() + scale * voxel.sum;
    point.intensity = scale * voxel.intensity_sum;
  }
  return points;
}

}  // namespace fdi_lio::mapping
