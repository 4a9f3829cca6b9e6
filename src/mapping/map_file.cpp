#include "fdi_lio/mapping/map_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <numeric>
#include <utility>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/voxel_cells.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kTile = 50.0;              ///< least side [m]
constexpr std::size_t kBytesOfVoxel = 100;  ///< with its place in the index
/// Voxels are counted by those whose mixed key begins with so many zeros.
constexpr int kSampleBits = 6;
/// Points that wait for their tiles to be built on.
constexpr std::size_t kMostWaiting = 500'000;

/// Clouds that are asked for one after the other, which may lie on disk, and then moved side by side.
constexpr std::size_t kClouds = 16;

/// Numbers the tiles in the order in which they are first met, which is that of the way.
class TileNumbers {
 public:
  explicit TileNumbers(double voxel_m) {
    while (std::ldexp(voxel_m, shift_) < kTile) ++shift_;
  }

  /// One number for the tile's place.
  std::uint64_t key_of_tile(const Eigen::Vector3i& cell) const {
    return (static_cast<std::uint64_t>(cell.x() >> shift_) << 32U) |
           static_cast<std::uint32_t>(cell.y() >> shift_);
  }

  std::uint32_t of(const Eigen::Vector3i& cell) { return index_.find_or_add(key_of_tile(cell)); }

  /// Of a tile that has a number.
  std::uint32_t find(std::uint64_t key) const { return index_.find(key); }

  std::size_t size() const { return index_.size(); }

 private:
  int shift_ = 0;  ///< a side has 2^shift voxels
  KeyIndex index_;
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
    if (!is_sampled(cell)) return;
    const std::size_t known = index_.size();
    if (index_.find_or_add(key_of(cell)) == known) ++sampled_[tile];
  }

  static bool is_sampled(const Eigen::Vector3i& cell) {
    return (key_of(cell) * 0xD6E8FEB86659FD93ULL) >> (64 - kSampleBits) == 0;
  }

  std::size_t tiles() const { return sampled_.size(); }
  /// Rather too many: a tile takes the memory of some hundred voxels anyway.
  std::size_t voxels(std::uint32_t tile) const { return (sampled_[tile] + std::size_t{8}) << kSampleBits; }

 private:
  KeyIndex index_;
  std::vector<std::uint32_t> sampled_;
};

/// Calls `look(k, cloud, i)` for the keyframes `numbers[i]` = k from `first` on, some side by side; how many.
template <typename Look>
std::size_t for_some_clouds(const MapSource& source, const std::vector<std::size_t>& numbers,
                            std::size_t first, const Look& look) {
  std::vector<std::shared_ptr<const KeyframeCloud>> clouds;
  for (std::size_t i = first; i < std::min(first + kClouds, numbers.size()); ++i)
    clouds.push_back(source.cloud(numbers[i]));
  parallel_chunks(clouds.size(), 1,
                  [&](std::size_t i, std::size_t, std::size_t) { look(numbers[first + i], *clouds[i], i); });
  return clouds.size();
}

std::vector<Batch> make_batches(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
                                const MapFileSettings& settings, TileNumbers* numbers) {
  VoxelCount count;
  std::vector<std::vector<std::size_t>> keyframes_of_tile;
  std::vector<std::size_t> all(source.size);
  std::iota(all.begin(), all.end(), std::size_t{0});
  for (std::size_t first = 0; first < all.size();) {
    // Of each cloud the first voxel in each tile, and the sample.
    std::array<std::vector<Eigen::Vector3i>, kClouds> noted;
    const auto note = [&](std::size_t k, const KeyframeCloud& cloud, std::size_t i) {
      TileNumbers own(settings.voxel_m);
      for_each_cell(cloud.*layer, source.T_map_imu(k), settings.voxel_m,
                    [&](const Point&, const Eigen::Vector3f&, const Eigen::Vector3i& cell) {
                      const std::size_t known = own.size();
                      if (own.of(cell) == known || VoxelCount::is_sampled(cell)) noted[i].push_back(cell);
                    });
    };
    const std::size_t looked = for_some_clouds(source, all, first, note);
    for (std::size_t i = 0; i < looked; ++i) {
      for (const Eigen::Vector3i& cell : noted[i]) {
        const std::uint32_t tile = numbers->of(cell);
        count.add(tile, cell);
        if (tile >= keyframes_of_tile.size()) keyframes_of_tile.resize(tile + 1);
        std::vector<std::size_t>& keyframes = keyframes_of_tile[tile];
        if (keyframes.empty() || keyframes.back() != first + i) keyframes.push_back(first + i);
      }
    }
    first += looked;
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

/// Points of one cloud by tile.
using Shares = std::map<std::uint32_t, std::vector<VoxelPoint>>;

/// Those in the tiles of the batch.
Shares shares_of(const std::vector<Point>& points, const Eigen::Isometry3d& T_map_imu, double voxel_m,
                 const Batch& batch, const TileNumbers& numbers) {
  Shares shares;
  std::uint64_t last_key = 0;
  std::vector<VoxelPoint>* last = nullptr;  // points come in the order of the beam: many fall into one tile
  bool is_first = true;
  for_each_cell(points, T_map_imu, voxel_m,
                [&](const Point& point, const Eigen::Vector3f& offset, const Eigen::Vector3i& cell) {
                  const std::uint64_t key = numbers.key_of_tile(cell);
                  if (is_first || key != last_key) {
                    const std::uint32_t tile = numbers.find(key);
                    last = tile >= batch.begin && tile < batch.end ? &shares[tile] : nullptr;
                    last_key = key;
                    is_first = false;
                  }
                  if (last != nullptr) last->push_back({cell, offset, point.intensity});
                });
  return shares;
}

/// The tiles of a batch. Points wait until there are many: then the voxels of a tile are in the processor's
/// memory while they are filled, which those of a whole scan would not be.
std::vector<MapBuilder> build_tiles(const MapSource& source, std::vector<Point> KeyframeCloud::*layer,
                                    double voxel_m, const Batch& batch, const TileNumbers& numbers) {
  std::vector<MapBuilder> tiles;
  for (std::uint32_t tile = batch.begin; tile < batch.end; ++tile) tiles.emplace_back(voxel_m);
  std::vector<Shares> waiting;
  const auto build = [&] {
    parallel_chunks(tiles.size(), 1, [&](std::size_t tile, std::size_t, std::size_t) {
      for (const Shares& shares : waiting) {
        const auto share = shares.find(batch.begin + static_cast<std::uint32_t>(tile));
        if (share != shares.end()) tiles[tile].add(share->second);
      }
    });
    waiting.clear();
  };
  std::size_t points = 0;
  for (std::size_t first = 0; first < batch.keyframes.size();) {
    std::array<Shares, kClouds> shares;
    const auto share = [&](std::size_t k, const KeyframeCloud& cloud, std::size_t i) {
      shares[i] = shares_of(cloud.*layer, source.T_map_imu(k), voxel_m, batch, numbers);
    };
    const std::size_t looked = for_some_clouds(source, batch.keyframes, first, share);
    for (std::size_t i = 0; i < looked; ++i) {
      for (const auto& [tile, placed] : shares[i]) points += placed.size();
      waiting.push_back(std::move(shares[i]));
    }
    first += looked;
    if (points < kMostWaiting) continue;
    build();
    points = 0;
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
    for (const MapBuilder& tile : build_tiles(source, layer, settings.voxel_m, batch, numbers))
      tile.for_each([&file](const Point& point) { file.add(point); });
  }
  file.close();
}

}  // namespace fdi_lio::mapping
