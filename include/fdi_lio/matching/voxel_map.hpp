#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/key_index.hpp"

namespace fdi_lio::matching {

/// Gaussian of the points in one cell, with its principal axes. What matching looks at comes first.
struct Cell {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::uint32_t count = 0;
  std::uint32_t scans = 0;                              ///< that gave points
  std::uint32_t newest_scan = 0;                        ///< number of the last of them, counted from 1
  std::uint32_t count_at_update = 0;                    ///< points that axes and variances were computed from
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();  ///< ascending [m^2]
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();   ///< columns, smallest variance first
  /// Mean of the unit vectors from the sensor to the points (map frame): the side that they were seen from.
  Eigen::Vector3d view = Eigen::Vector3d::Zero();
  /// Mean of what the points move by with the elevation of their beams (map frame) [m/rad].
  Eigen::Vector3d lever = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();  ///< sum of squared deviations from the mean
  /// Elevations that the points were seen at from the sensor's place at the stamp, in steps of 6 mrad, as
  /// bits (modulo 64): at rest the beams that they come from.
  std::uint64_t beams = 0;
  float mean_intensity = 0.0F;
  std::uint32_t listed_at = 0;     ///< number of the newest insertion after which the axes are computed again
  double intensity_scatter = 0.0;  ///< sum of squared deviations from the mean intensity
  /// Sum of (position - mean) (intensity - mean intensity).
  Eigen::Vector3d cross_scatter = Eigen::Vector3d::Zero();
  /// Regression of intensity on the position in the surface: I(x) = mean_intensity + gradient . (x - mean),
  /// map frame [1/m], and the variance that it leaves. Zero where no gradient stands out from its own error.
  Eigen::Vector3d intensity_gradient = Eigen::Vector3d::Zero();
  double intensity_variance = 0.0;

  /// How many beams the points come from: those of one share its errors. At least 1.
  double beam_count() const { return std::max<double>(1.0, std::bitset<64>(beams).count()); }
};

/// Things by number, in pieces: growing neither moves those that are there, which takes longer than a scan
/// may when there are a million, nor keeps room for as many again.
template <typename Thing>
class Pool {
 public:
  Thing& operator[](std::uint32_t number) { return (*pieces_[number / kPiece])[number % kPiece]; }
  const Thing& operator[](std::uint32_t number) const { return (*pieces_[number / kPiece])[number % kPiece]; }

  /// The number of a new one, or of one that was given back.
  std::uint32_t take() {
    if (!free_.empty()) {
      const std::uint32_t number = free_.back();
      free_.pop_back();
      (*this)[number] = Thing();
      return number;
    }
    if (end_ == kPiece * pieces_.size()) pieces_.push_back(std::make_unique<Piece>());
    return end_++;
  }
  void give_back(std::uint32_t number) { free_.push_back(number); }

  /// Those in use.
  std::size_t size() const { return end_ - free_.size(); }
  /// Above all numbers, those given back included.
  std::uint32_t end() const { return end_; }

 private:
  static constexpr std::size_t kPiece = 1024;
  using Piece = std::array<Thing, kPiece>;

  std::vector<std::unique_ptr<Piece>> pieces_;
  std::uint32_t end_ = 0;
  std::vector<std::uint32_t> free_;
};

struct VoxelMapConfig {
  double voxel_size_m = 0.4;       ///< finest level
  std::uint32_t min_points = 6;    ///< before a cell is used
  std::uint32_t max_points = 200;  ///< a cell stops averaging
  double max_thickness_m = 0.1;    ///< deviation across a plane or a line
  bool with_texture = false;       ///< find intensity gradients
  std::uint32_t min_scans = 3;     ///< that a cell needs for an intensity gradient
};

/// Incremental voxel hash with three levels of cells: 1, 2 and 4 times the voxel size. A hash entry is one
/// block of the coarsest level; the finer cells are found in it by index. Each cell keeps the running mean
/// and scatter of its points, so that a plane costs no neighbour search, and its noise averages out as the
/// scans go by.
class VoxelMap {
 public:
  explicit VoxelMap(const VoxelMapConfig& config);

  /// Adds points (map frame) with their intensities (same size), seen by a lidar that spins about its z axis.
  void insert(const std::vector<Eigen::Vector3d>& points, const std::vector<float>& intensities,
              const Eigen::Isometry3d& T_map_lidar);

  /// The finest cell around each of `count` points that is a plane; nullptr where there is none. With `wide`
  /// also the planes of the neighbouring coarsest cells, the nearest to the point. Many at once wait for
  /// memory together.
  void find_planes(const Eigen::Vector3d* points, std::size_t count, bool wide, const Cell** cells) const;

  /// The finest cell around each of `count` points that is a line; nullptr where there is none.
  void find_lines(const Eigen::Vector3d* points, std::size_t count, const Cell** cells) const;

  /// The finest cell around each of `count` points that has an intensity gradient; nullptr where there is
  /// none.
  void find_textures(const Eigen::Vector3d* points, std::size_t count, const Cell** cells) const;

  /// `find_planes` of one point.
  const Cell* find_plane(const Eigen::Vector3d& point, bool wide) const;

  /// Forgets blocks that are farther than `radius_m` from `center`, and cells that 600 insertions ago had too
  /// few points to be used and have got none since: of moving objects, noise and far surfaces there are
  /// always new ones, and their number would grow with the hours.
  void tidy(const Eigen::Vector3d& center, double radius_m);

  /// Finest cells that hold a point.
  std::vector<const Cell*> finest_cells() const;

  std::size_t cell_count() const { return cells_.size(); }
  bool empty() const { return blocks_.size() == 0; }

 private:
  static constexpr int kCellsPerBlock = 1 + 8 + 64;
  using Key = std::uint64_t;

  /// A cell with what it can be matched as: most lookups end here, without touching cells that are of no use.
  class CellReference {
   public:
    enum Kind : std::uint32_t { kPlane = 1, kLine = 2, kTexture = 4 };

    bool is_empty() const { return bits_ == kEmpty; }
    bool is(Kind kind) const { return !is_empty() && (bits_ & kind) != 0; }
    std::uint32_t cell() const { return bits_ >> kKindBits; }
    void set(std::uint32_t cell, std::uint32_t kinds) { bits_ = cell << kKindBits | kinds; }

   private:
    static constexpr std::uint32_t kEmpty = 0xFFFFFFFFU;
    static constexpr int kKindBits = 3;

    std::uint32_t bits_ = kEmpty;
  };

  struct Block {
    Key key = 0;
    std::uint32_t tidy_at = 0;                        ///< no cell can be forgotten before that insertion
    std::array<CellReference, kCellsPerBlock> cells;  ///< the first is there unless the block was given back
  };
  struct Address {
    Key key;
    std::array<int, 3> slots;  ///< coarsest, middle, finest
  };
  struct Sighting;
  struct Dirty;

  Address address_of(const Eigen::Vector3d& point) const;
  Eigen::Vector3d center_of(const Block& block) const;
  Block* block_at(Key key);
  void add(const Sighting& sighting, int slot, CellReference* reference, std::vector<Dirty>* dirty);
  void update_axes(double size_m, CellReference* reference);
  bool is_forgotten(const Cell& cell) const;
  bool has_left(const Block& block, const Eigen::Vector3d& center, double radius_m) const;
  void find_finest(const Eigen::Vector3d* points, std::size_t count, CellReference::Kind kind,
                   const Cell** cells) const;
  const Cell* find_wide_plane(const Eigen::Vector3d& point) const;

  VoxelMapConfig config_;
  double block_size_m_;
  double blocks_per_m_;
  KeyIndex index_;  ///< of the blocks
  Pool<Block> blocks_;
  Pool<Cell> cells_;
  std::uint32_t scans_ = 0;  ///< insertions so far
};

}  // namespace fdi_lio::matching
