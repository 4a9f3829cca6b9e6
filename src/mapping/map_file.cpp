#include "fdi_lio/mapping/map_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kTile = 50.0;              ///< least side [m]
constexpr std::size_t kBytesOfPoint = 200;  ///< with its voxel, the place of it in the index, and its mean

/// Numbers the tiles in the order in which they are first met, which is that of the way.
class Tiles {
 public:
  explicit Tiles(double voxel_m) {
    while (std::ldexp(voxel_m, shift_) < kTile) ++shift_;
  }

  std::uint32_t of(const Eigen::Vector3i& cell) {
    const std::uint64_t key = (static_cast<std::uint64_t>(cell.x() >> shift_) << 32U) |
                              static_cast<std::uint32_t>(cell.y() >> shift_);
    if (key == last_key_ && index_.size() > 0) return last_;
    last_key_ = key;
    last_ = index_.find_or_add(key);
    if (last_ == corners_.size())
      corners_.emplace_back(cell.x() >> shift_ << shift_, cell.y() >> shift_ << shift_, 0);
    return last_;
  }

  /// Its first voxel.
  const Eigen::Vector3i& corner(std::uint32_t tile) const { return corners_[tile]; }

 private:
  int shift_ = 0;  ///< a side has 2^shift voxels
  KeyIndex index_;
  std::vector<Eigen::Vector3i> corners_;
  std::uint64_t last_key_ = 0;
  std::uint32_t last_ = 0;
};

/// Tiles that are built together.
struct Batch {
  std::uint32_t first = 0;               ///< of its tiles
  std::vector<std::size_t> begin = {0};  ///< of each tile among the points of the batch, and of the end
  std::vector<std::size_t> keyframes;    ///< that have points there

  std::size_t tiles() const { return begin.size() - 1; }
  std::size_t points() const { return begin.back(); }
};

/// A point of a tile.
struct Placed {
  Eigen::Vector3f position;  ///< from the tile's corner [voxels]
  float intensity;
};

std::vector<Batch> make_batches(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
                                const MapFileSettings& settings, Tiles* tiles) {
  std::vector<std::size_t> points_of_tile;
  std::vector<std::vector<std::size_t>> keyframes_of_tile;
  for (std::size_t k = 0; k < source.size; ++k) {
    const auto cloud = source.cloud(k);
    for_each_cell((*cloud).*layer, source.T_map_imu(k), settings.voxel_m,
                  [&](const Point&, const Eigen::Vector3f&, const Eigen::Vector3i& cell) {
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
  std::vector<Batch> batches;
  for (std::uint32_t tile = 0; tile < points_of_tile.size(); ++tile) {
    if (batches.empty() || batches.back().points() + points_of_tile[tile] > settings.most_points) {
      batches.emplace_back();
      batches.back().first = tile;
    }
    Batch& batch = batches.back();
    batch.begin.push_back(batch.points() + points_of_tile[tile]);
    batch.keyframes.insert(batch.keyframes.end(), keyframes_of_tile[tile].begin(),
                           keyframes_of_tile[tile].end());
  }
  for (Batch& batch : batches) {
    std::sort(batch.keyframes.begin(), batch.keyframes.end());
    batch.keyframes.erase(std::unique(batch.keyframes.begin(), batch.keyframes.end()), batch.keyframes.end());
  }
  return batches;
}

/// Puts the points of a batch into `points`, tile after tile, those of a tile in the order of the keyframes.
void collect(const MapSource& source, std::vector<Point> KeyframeCloud::*layer, double voxel_m,
             const Batch& batch, Tiles* tiles, std::vector<Placed>* points) {
  points->resize(batch.points());
  std::vector<std::size_t> next(batch.begin.begin(), batch.begin.end() - 1);
  for (const std::size_t k : batch.keyframes) {
    const auto cloud = source.cloud(k);
    for_each_cell((*cloud).*layer, source.T_map_imu(k), voxel_m,
                  [&](const Point& point, const Eigen::Vector3f& offset, const Eigen::Vector3i& cell) {
                    const std::uint32_t tile = tiles->of(cell);
                    if (tile < batch.first || tile - batch.first >= batch.tiles()) return;
                    (*points)[next[tile - batch.first]++] = {
                        offset + (cell - tiles->corner(tile)).cast<float>(), point.intensity};
                  });
  }
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
  std::vector<Placed> points;
  for (const Batch& batch : make_batches(source, layer, settings, &tiles)) {
    collect(source, layer, settings.voxel_m, batch, &tiles, &points);
    std::vector<std::vector<Point>> means(batch.tiles());
    parallel_chunks(batch.tiles(), 1, [&](std::size_t tile, std::size_t, std::size_t) {
      const Eigen::Vector3i& corner = tiles.corner(batch.first + static_cast<std::uint32_t>(tile));
      MapBuilder map(settings.voxel_m);
      for (std::size_t k = batch.begin[tile]; k < batch.begin[tile + 1]; ++k) {
        const Eigen::Vector3i cell = cell_of(points[k].position);
        map.add(corner + cell, points[k].position - cell.cast<float>(), points[k].intensity);
      }
      means[tile] = map.points();
    });
    for (const std::vector<Point>& tile : means) {
      for (const Point& point : tile) file.add(point);
    }
  }
  file.close();
}

}  // namespace fdi_lio::mapping
