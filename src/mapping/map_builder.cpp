#include "fdi_lio/mapping/map_builder.hpp"

#include <cstdio>
#include <fstream>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::mapping {

MapBuilder::MapBuilder(double voxel_m) : voxel_m_(voxel_m) {}

void MapBuilder::add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Matrix3d R = T_map_lidar.rotation();
  const Eigen::Vector3d t = T_map_lidar.translation();
  for (const Point& point : points) {
    const Eigen::Vector3d p_map = R * point.position.cast<double>() + t;
    const Eigen::Vector3d scaled = p_map / voxel_m_;
    Eigen::Vector3i cell = scaled.cast<int>();  // std::floor is a call on the plainest x86-64
    for (int axis = 0; axis < 3; ++axis) cell[axis] -= scaled[axis] < cell[axis] ? 1 : 0;
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)
      key = (key << 21) | (static_cast<std::uint64_t>(cell[axis]) & 0x1fffff);
    const std::uint32_t number = index_.find_or_add(key);
    if (number == voxels_.size()) {
      voxels_.emplace_back();
      voxels_.back().cell = cell;
    }
    Voxel& voxel = voxels_[number];
    voxel.sum += (p_map - voxel_m_ * cell.cast<double>()).cast<float>();
    voxel.intensity_sum += point.intensity;
    ++voxel.count;
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

void MapBuilder::write_pcd(const std::string& path) const {
  std::vector<float> data;
  data.reserve(4 * voxels_.size());
  for (const Point& point : points()) {
    data.insert(data.end(), {point.position.x(), point.position.y(), point.position.z(), point.intensity});
  }
  const std::string temporary = path + ".part";
  std::ofstream out(temporary, std::ios::binary);
  out << "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 "
         "4\nTYPE F F F F\n"
      << "COUNT 1 1 1 1\nWIDTH " << voxels_.size() << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS "
      << voxels_.size() << "\nDATA binary\n";
  out.write(reinterpret_cast<const char*>(data.data()),
            static_cast<std::streamsize>(data.size() * sizeof(float)));
  out.close();
  if (!out || std::rename(temporary.c_str(), path.c_str()) != 0) {
    std::remove(temporary.c_str());
    throw Error("cannot write the map " + path +
                ": check free space and permission; an earlier file was left as it was");
  }
}

}  // namespace fdi_lio::mapping
