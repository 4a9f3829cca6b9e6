#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::mapping {

/// Calls `use(point, p_map, cell)` for each point, with its place in `map` and the voxel that it lies in.
template <typename Use>
void for_each_cell(const std::vector<Point>& points, const Eigen::Isometry3d& T_map, double voxel_m,
                   const Use& use) {
  const Eigen::Matrix3d R = T_map.rotation();
  const Eigen::Vector3d t = T_map.translation();
  for (const Point& point : points) {
    const Eigen::Vector3d p_map = R * point.position.cast<double>() + t;
    const Eigen::Vector3d scaled = p_map / voxel_m;
    Eigen::Vector3i cell = scaled.cast<int>();  // std::floor is a call on the plainest x86-64
    for (int axis = 0; axis < 3; ++axis) cell[axis] -= scaled[axis] < cell[axis] ? 1 : 0;
    use(point, p_map, cell);
  }
}

/// A map of keyframe clouds in `map`, one mean point a voxel.
class MapBuilder {
 public:
  /// The index makes room for `expected_voxels`.
  explicit MapBuilder(double voxel_m, std::size_t expected_voxels = 0);

  /// Adds the points of one cloud; `T_map` <- the frame that they are given in.
  void add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map) {
    add_if(points, T_map, [](const Eigen::Vector3i&) { return true; });
  }

  /// Adds those of the points for whose voxels `accept(cell)` says so.
  template <typename Accept>
  void add_if(const std::vector<Point>& points, const Eigen::Isometry3d& T_map, const Accept& accept) {
    // Points come in the order of the beam: most fall into the voxel of the one before.
    std::uint64_t last_key = 0;
    Voxel* last = nullptr;
    for_each_cell(points, T_map, voxel_m_,
                  [&](const Point& point, const Eigen::Vector3d& p_map, const Eigen::Vector3i& cell) {
                    if (!accept(cell)) return;
                    const std::uint64_t key = key_of(cell);
                    if (last == nullptr || key != last_key) {
                      last_key = key;
                      last = voxel_of(key, cell);
                    }
                    last->sum += (p_map - voxel_m_ * cell.cast<double>()).cast<float>();
                    last->intensity_sum += point.intensity;
                    ++last->count;
                  });
  }

  std::size_t size() const { return voxels_.size(); }

  /// Calls `use` for one mean point a voxel, in `map`, in the order in which the voxels were first filled.
  template <typename Use>
  void for_each(const Use& use) const {
    for (const Voxel& voxel : voxels_) use(mean_of(voxel));
  }

  /// The same points as `for_each` gives.
  std::vector<Point> points() const;

 private:
  struct Voxel {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();  ///< of offsets from the voxel's corner
    float intensity_sum = 0.0F;
    std::uint32_t count = 0;
    Eigen::Vector3i cell = Eigen::Vector3i::Zero();
  };

  static std::uint64_t key_of(const Eigen::Vector3i& cell);
  Voxel* voxel_of(std::uint64_t key, const Eigen::Vector3i& cell);
  Point mean_of(const Voxel& voxel) const;

  double voxel_m_;
  KeyIndex index_;
  std::deque<Voxel> voxels_;  ///< in the order in which they were first filled; grows without being copied
};

}  // namespace fdi_lio::mapping
