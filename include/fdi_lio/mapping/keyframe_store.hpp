#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::mapping {

/// The points of one keyframe, IMU frame at its stamp. Only position and intensity are kept.
struct KeyframeCloud {
  std::vector<Point> surface;  ///< all points, one mean a voxel
  std::vector<Point> planes;   ///< plane features
  std::vector<Point> edges;    ///< edge features

  std::size_t size() const { return surface.size() + planes.size() + edges.size(); }
};

/// A keyframe's points and where they are in the frame of the submap.
struct PlacedCloud {
  std::shared_ptr<const KeyframeCloud> cloud;
  Eigen::Isometry3d T_submap_imu = Eigen::Isometry3d::Identity();
};

/// Clouds of all keyframes. Those used last stay in memory up to a limit; the others are written to an
/// unnamed file in the temporary folder, which vanishes with the process however it ends.
class KeyframeStore {
 public:
  /// Throws Error when the file cannot be made.
  explicit KeyframeStore(std::size_t memory_limit_bytes);
  ~KeyframeStore();
  KeyframeStore(const KeyframeStore&) = delete;
  KeyframeStore& operator=(const KeyframeStore&) = delete;

  /// Throws Error when the disk takes no more.
  void add(KeyframeCloud cloud);

  /// Another limit, which holds when the next cloud comes into memory.
  void set_memory_limit(std::size_t bytes) { memory_limit_bytes_ = bytes; }
  std::size_t memory_limit_bytes() const { return memory_limit_bytes_; }

  /// The cloud of keyframe `index`, in the order of `add`. Throws Error when it cannot be read back, or when
  /// the disk does not take the one that makes room for it.
  std::shared_ptr<const KeyframeCloud> get(std::size_t index);

  /// Puts another cloud in the place of that of keyframe `index`. Throws as `get`.
  void replace(std::size_t index, KeyframeCloud cloud);

  std::size_t size() const { return records_.size(); }
  std::size_t bytes_in_memory() const { return bytes_in_memory_; }

 private:
  struct Record {
    std::optional<std::int64_t> offset;  ///< in the file, once written
    std::uint32_t surface = 0;
    std::uint32_t planes = 0;
    std::uint32_t edges = 0;
    std::shared_ptr<const KeyframeCloud> cloud;  ///< while in memory
    std::list<std::size_t>::iterator place;      ///< in `recent_`, while in memory
  };

  void set(std::size_t index, KeyframeCloud cloud);
  void write(Record* record);
  void keep(std::size_t index, std::shared_ptr<const KeyframeCloud> cloud);

  std::size_t memory_limit_bytes_;
  int file_ = -1;
  std::int64_t end_ = 0;
  std::vector<Record> records_;
  std::list<std::size_t> recent_;  ///< in memory, the newest use first
  std::size_t bytes_in_memory_ = 0;
  std::size_t bytes_dropped_ = 0;  ///< since the allocator was asked to give back what is free
};

}  // namespace fdi_lio::mapping
