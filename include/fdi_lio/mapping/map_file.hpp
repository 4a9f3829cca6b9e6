#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/cloud_file.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/mapping/keyframe_store.hpp"

namespace fdi_lio::mapping {

/// Keyframes whose clouds make a map. The clouds may lie on disk: they are asked for one at a time.
struct MapSource {
  std::size_t size = 0;
  std::function<std::shared_ptr<const KeyframeCloud>(std::size_t)> cloud;
  std::function<Eigen::Isometry3d(std::size_t)> T_map_imu;
};

MapSource map_source(const GlobalOptimizer& global);

struct MapFileSettings {
  double voxel_m = 0.1;
  CloudFormat format = CloudFormat::kPcd;
  /// Voxels that are built at a time, each taking about 100 bytes. A tile is never split.
  std::size_t most_voxels = 1'250'000;
};

/// Settings that keep to the memory of the clouds.
MapFileSettings map_file_settings(const GlobalOptimizer& global, double voxel_m, CloudFormat format);

/// Writes one layer of the clouds as a map in `map`, one mean point a voxel. Seen from above the map is cut
/// into tiles of at least 50 m, which are built some at a time, as many as have `most_voxels`, and one tile
/// after the other: the memory does not grow with the way, and the voxels of a tile fit the processor's.
/// Throws Error when the file cannot be written; an earlier one stays whole until the new one is.
void write_map(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
               const MapFileSettings& settings, const std::string& path);

}  // namespace fdi_lio::mapping
