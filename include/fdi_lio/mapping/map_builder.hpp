#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/voxel_cells.hpp"

namespace fdi_lio::mapping {

/// Calls `use(point, offset, cell)` for each point: the voxel that it lies in when moved to `map`, and how
/// far from the voxel's corner, in voxels.
template <typename Use>
void for_each_cell(const std::vector<Point>& points, const Eigen::Isometry3d& T_map, double voxel_m,
                   const Use& use) {
  // Counted from the voxel of the cloud's origin: so near to it floats are precise enough.
  const Eigen::Vector3d origin = T_map.translation() / voxel_m;
  const Eigen::Vector3d origin_corner = origin.array().floor();
  const Eigen::Vector3i origin_cell = origin_corner.cast<int>();
  const Eigen::Matrix3f R = (T_map.linear() / voxel_m).cast<float>();
  const Eigen::Vector3f t = (origin - origin_corner).cast<float>();
  for (const Point& point : points) {
    const Eigen::Vector3f scaled = R * point.position + t;
    const Eigen::Vector3i cell = cell_of(scaled);
    use(point, scaled - cell.cast<float>(), origin_cell + cell);
  }
}

/// A point of a cloud that was moved to `map`.
struct VoxelPoint {
  Eigen::Vector3i cell;
  Eigen::Vector3f offset;  ///< from the voxel's corner [voxels]
  float intensity;
};

/// A map of keyframe clouds in `map`, one mean point a voxel.
class MapBuilder {
 public:
  explicit MapBuilder(double voxel_m) : voxel_m_(voxel_m) {}
  ~MapBuilder() = default;
  MapBuilder(const MapBuilder&) = delete;  // `last_` would point into the other
  MapBuilder& operator=(const MapBuilder&) = delete;
  MapBuilder(MapBuilder&&) = default;
  MapBuilder& operator=(MapBuilder&&) = default;

  /// Adds the points of one cloud; `T_map` <- the frame that they are given in.
  void add(const std::vector<Point>& points, const Eigen::Isometry3d& T_map);

  void add(const std::vector<VoxelPoint>& points);

  std::size_t size() const { return index_.size(); }

  /// Empties the map; what comes next uses its memory.
  void clear() { index_.clear(); }

  /// Calls `use` for one mean point a voxel, in `map`, in the order in which the voxels were first filled.
  template <typename Use>
  void for_each(const Use& use) const {
    for (std::uint32_t number = 0; number < size(); ++number)
      use(mean_of(blocks_[number / kBlock][number % kBlock]));
  }

  /// The same points as `for_each` gives.
  std::vector<Point> points() const;

 private:
  struct Voxel {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();  ///< of offsets from the corner [voxels]
    float intensity_sum = 0.0F;
    std::uint32_t count = 0;
    Eigen::Vector3i cell = Eigen::Vector3i::Zero();
  };

  static constexpr std::size_t kBlock = 1024;

  void add(const VoxelPoint& point);
  Voxel* voxel_of(const Eigen::Vector3i& cell);
  Point mean_of(const Voxel& voxel) const;

  double voxel_m_;
  KeyIndex index_;
  /// Voxels in the order in which they were first filled, in blocks: a large map grows without being copied.
  std::vector<std::vector<Voxel>> blocks_;
  Voxel* last_ = nullptr;           ///< that a point was added to
  std::vector<VoxelPoint> placed_;  ///< memory of `add`
};

}  // namespace fdi_lio::mapping
