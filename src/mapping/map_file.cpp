#include "fdi_lio/mapping/map_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kTile = 50.0;              ///< [m]
constexpr std::size_t kBytesOfPoint = 100;  ///< with its voxel and the place of it in the index

/// Numbers the tiles in the order in which they are first met, which is that of the way.
class Tiles {
 public:
  explicit Tiles(double voxel_m) : cells_(std::max(1, static_cast<int>(std::ceil(kTile / voxel_m)))) {}

  std::uint32_t of(const Eigen::Vector3i& cell) {
    const std::uint64_t key =
        (static_cast<std::uint64_t>(tile(cell.x())) << 32U) | static_cast<std::uint32_t>(tile(cell.y()));
    if (key == last_key_ && index_.size() > 0) return last_;
    last_key_ = key;
    last_ = index_.find_or_add(key);
    return last_;
  }

 private:
  int tile(int cell) const { return cell >= 0 ? cell / cells_ : (cell + 1) / cells_ - 1; }

  int cells_;  ///< voxels along a side
  KeyIndex index_;
  std::uint64_t last_key_ = 0;
  std::uint32_t last_ = 0;
};

/// Which tiles are built together, and from which keyframes.
struct Plan {
  std::vector<std::size_t> batch_of_tile;
  std::vector<std::vector<std::size_t>> keyframes;  ///< of each batch
};

Plan make_plan(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
               const MapFileSettings& settings, Tiles* tiles) {
  std::vector<std::size_t> points_of_tile;
  std::vector<std::vector<std::size_t>> keyframes_of_tile;
  for (std::size_t k = 0; k < source.size; ++k) {
    const auto cloud = source.cloud(k);
    for_each_cell((*cloud).*layer, source.T_map_imu(k), settings.voxel_m,
                  [&](const Point&, const Eigen::Vector3d&, const Eigen::Vector3i& cell) {
                    const std::uint32_t tile = tiles->of(cell);
                    if (tile >= points_of_tile.size()) {
                      points_of_tile.resize(tile + 1, 0);
                      keyframes_of_tile.resize(tile + 1);
                    }
                    ++points_of_tile[tile];
                    std::vector<std::size_t>& keyframes = keyframes_of_tile[tile];
                    if (keyframes.empty() || keyframes.back() != k) keyframes.push_back(k);
                  });
  }
  Plan plan;
  std::size_t points = settings.most_points;
  for (std::size_t tile = 0; tile < points_of_tile.size(); ++tile) {
    if (points + points_of_tile[tile] > settings.most_points) {
      plan.keyframes.emplace_back();
      points = 0;
    }
    points += points_of_tile[tile];
    plan.batch_of_tile.push_back(plan.keyframes.size() - 1);
    std::vector<std::size_t>& keyframes = plan.keyframes.back();
    keyframes.insert(keyframes.end(), keyframes_of_tile[tile].begin(), keyframes_of_tile[tile].end());
  }
  for (std::vector<std::size_t>& keyframes : plan.keyframes) {
    std::sort(keyframes.begin(), keyframes.end());
    keyframes.erase(std::unique(keyframes.begin(), keyframes.end()), keyframes.end());
  }
  return plan;
}

}  // namespace

MapSource map_source(const GlobalOptimizer& global) {
  return {global.size(), [&global](std::size_t k) { return global.cloud(k); },
          [&global](std::size_t k) { return global.T_map_imu(k); }};
}

MapFileSettings map_file_settings(const GlobalOptimizer& global, double voxel_m, CloudFormat format) {
  return {voxel_m, format, (global.cloud_memory_mb() << 20U) / kBytesOfPoint};
}

void write_map(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
               const MapFileSettings& settings, const std::string& path) {
  CloudFile file(path, settings.format);
  Tiles tiles(settings.voxel_m);
  const Plan plan = make_plan(source, layer, settings, &tiles);
  for (std::size_t batch = 0; batch < plan.keyframes.size(); ++batch) {
    MapBuilder map(settings.voxel_m);
    for (const std::size_t k : plan.keyframes[batch]) {
      const auto cloud = source.cloud(k);
      map.add_if((*cloud).*layer, source.T_map_imu(k),
                 [&](const Eigen::Vector3i& cell) { return plan.batch_of_tile[tiles.of(cell)] == batch; });
    }
    map.for_each([&file](const Point& point) { file.add(point); });
  }
  file.close();
}

}  // namespace fdi_lio::mapping
