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
constexpr std::size_t kBytesOfVoxel = 100;  ///< with its place in the index
/// Voxels are counted by those whose mixed key begins with so many zeros.
constexpr int kSampleBits = 6;
/// Points that wait for their tiles to be built on.
constexpr std::size_t kMostPending = 1'000'000;

/// Numbers the tiles in the order in which they are first met, which is that of the way.
class TileNumbers {
 public:
  explicit TileNumbers(double voxel_m) {
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
  std::uint32_t begin = 0;  ///< of its tiles
  std::uint32_t end = 0;
  std::vector<std::size_t> keyframes;  ///< that have points there
};

/// Counts the voxels of each tile by a sample of them.
class VoxelCount {
 public:
  void add(std::uint32_t tile, const Eigen::Vector3i& cell) {
    if (tile >= sampled_.size()) sampled_.resize(tile + 1, 0);
    const std::uint64_t key = key_of(cell);
    if ((key * 0xD6E8FEB86659FD93ULL) >> (64 - kSampleBits) != 0) return;
    const std::size_t known = index_.size();
    if (index_.find_or_add(key) == known) ++sampled_[tile];
  }

  std::size_t tiles() const { return sampled_.size(); }
  /// Rather too many: a tile takes the memory of some hundred voxels anyway.
  std::size_t voxels(std::uint32_t tile) const { return (sampled_[tile] + std::size_t{8}) << kSampleBits; }

 private:
  KeyIndex index_;
  std::vector<std::uint32_t> sampled_;
};

std::vector<Batch> make_batches(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
                                const MapFileSettings& settings, TileNumbers* numbers) {
  VoxelCount count;
  std::vector<std::vector<std::size_t>> keyframes_of_tile;
  for (std::size_t k = 0; k < source.size; ++k) {
    const auto cloud = source.cloud(k);
    for_each_cell((*cloud).*layer, source.T_map_imu(k), settings.voxel_m,
                  [&](const Point&, const Eigen::Vector3f&, const Eigen::Vector3i& cell) {
                    const std::uint32_t tile = numbers->of(cell);
                    count.add(tile, cell);
                    if (tile >= keyframes_of_tile.size()) keyframes_of_tile.resize(tile + 1);
                    std::vector<std::size_t>& keyframes = keyframes_of_tile[tile];
                    if (keyframes.empty() || keyframes.back() != k) keyframes.push_back(k);
                  });
  }
  std::vector<Batch> batches;
  std::size_t voxels = 0;
  for (std::uint32_t tile = 0; tile < count.tiles(); ++tile) {
    voxels += count.voxels(tile);
    if (batches.empty() || voxels > settings.most_voxels) {
      batches.emplace_back();
      batches.back().begin = tile;
      voxels = count.voxels(tile);
    }
    Batch& batch = batches.back();
    batch.end = tile + 1;
    batch.keyframes.insert(batch.keyframes.end(), keyframes_of_tile[tile].begin(),
                           keyframes_of_tile[tile].end());
  }
  for (Batch& batch : batches) {
    std::sort(batch.keyframes.begin(), batch.keyframes.end());
    batch.keyframes.erase(std::unique(batch.keyframes.begin(), batch.keyframes.end()), batch.keyframes.end());
  }
  return batches;
}

/// The map of one tile. Points wait until there are many: then the voxels of the tile are in the processor's
/// memory while they are filled, which those of a whole scan would not be.
class Tile {
 public:
  Tile(double voxel_m, const Eigen::Vector3i& corner) : corner_(corner), map_(voxel_m) {}

  void add(const Eigen::Vector3i& cell, const Eigen::Vector3f& offset, float intensity) {
    pending_.push_back({offset + (cell - corner_).cast<float>(), intensity});
  }

  void build() {
    for (const Placed& point : pending_) {
      const Eigen::Vector3i cell = cell_of(point.position);
      map_.add(corner_ + cell, point.position - cell.cast<float>(), point.intensity);
    }
    pending_.clear();
  }

  const MapBuilder& map() const { return map_; }

 private:
  struct Placed {
    Eigen::Vector3f position;  ///< from the corner [voxels]
    float intensity;
  };

  Eigen::Vector3i corner_;  ///< the first voxel
  std::vector<Placed> pending_;
  MapBuilder map_;
};

std::vector<Tile> build_tiles(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
                              double voxel_m, const Batch& batch, TileNumbers* numbers) {
  std::vector<Tile> tiles;
  for (std::uint32_t tile = batch.begin; tile < batch.end; ++tile)
    tiles.emplace_back(voxel_m, numbers->corner(tile));
  const auto build = [&tiles] {
    parallel_chunks(tiles.size(), 1,
                    [&tiles](std::size_t tile, std::size_t, std::size_t) { tiles[tile].build(); });
  };
  std::size_t pending = 0;
  for (const std::size_t k : batch.keyframes) {
    const auto cloud = source.cloud(k);
    for_each_cell((*cloud).*layer, source.T_map_imu(k), voxel_m,
                  [&](const Point& point, const Eigen::Vector3f& offset, const Eigen::Vector3i& cell) {
                    const std::uint32_t tile = numbers->of(cell);
                    if (tile < batch.begin || tile >= batch.end) return;
                    tiles[tile - batch.begin].add(cell, offset, point.intensity);
                    ++pending;
                  });
    if (pending < kMostPending) continue;
    build();
    pending = 0;
  }
  build();
  return tiles;
}

}  // namespace

MapSource map_source(const GlobalOptimizer& global) {
  return {global.size(), [&global](std::size_t k) { return global.cloud(k); },
          [&global](std::size_t k) { return global.T_map_imu(k); }};
}

MapFileSettings map_file_settings(const GlobalOptimizer& global, double voxel_m, CloudFormat format) {
  MapFileSettings settings;
  settings.voxel_m = voxel_m;
  settings.format = format;
  settings.most_voxels = std::min(settings.most_voxels, global.cloud_memory_bytes() / kBytesOfVoxel);
  return settings;
}

void write_map(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
               const MapFileSettings& settings, const std::string& path) {
  CloudFile file(path, settings.format);
  TileNumbers numbers(settings.voxel_m);
  for (const Batch& batch : make_batches(source, layer, settings, &numbers)) {
    for (const Tile& tile : build_tiles(source, layer, settings.voxel_m, batch, &numbers))
      tile.map().for_each([&file](const Point& point) { file.add(point); });
  }
  file.close();
}

}  // namespace fdi_lio::mapping
