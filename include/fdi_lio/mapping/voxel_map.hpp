#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

#include <Eigen/Core>

namespace fdi_lio::mapping {

/// Gaussian of the points in one cell, with its principal axes.
struct Cell {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();    ///< sum of squared deviations from the mean
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();   ///< columns, smallest variance first
  Eigen::Vector3d variances = Eigen::Vector3d::Zero();  ///< ascending [m^2]
  float mean_intensity = 0.0F;
  double intensity_scatter = 0.0;  ///< sum of squared deviations from the mean intensity
  /// Sum of (position - mean) (intensity - mean intensity).
  Eigen::Vector3d cross_scatter = Eigen::Vector3d::Zero();
  /// Regression of intensity on the position in the surface: I(x) = mean_intensity + gradient . (x - mean),
  /// map frame [1/m], and the variance that it leaves. Zero where no gradient stands out from its own error.
  Eigen::Vector3d intensity_gradient = Eigen::Vector3d::Zero();
  double intensity_variance = 0.0;
  std::uint32_t count = 0;
  std::uint32_t scans = 0;            ///< that gave points
  std::uint32_t newest_scan = 0;      ///< number of the last of them, counted from 1
  std::uint32_t count_at_update = 0;  ///< points that `axes` and `variances` were computed from
  bool is_plane = false;
  bool is_line = false;
  bool is_textured = false;  ///< has an intensity gradient
};

/// Cells by number, in pieces: growing neither moves those that are there, which takes longer than a scan may
/// when there are a million, nor keeps room for as many again.
class CellPool {
 public:
  Cell& operator[](std::int32_t index) { return (*pieces_[piece_of(index)])[place_of(index)]; }
  const Cell& operator[](std::int32_t index) const { return (*pieces_[piece_of(index)])[place_of(index)]; }

  /// The number of a new cell, or of one that was given back.
  std::int32_t take();
  void give_back(std::int32_t index) { free_.push_back(index); }

  /// Cells that are in use.
  std::size_t size() const { return used_ - free_.size(); }

 private:
  static constexpr std::size_t kPiece = 4096;
  using Piece = std::array<Cell, kPiece>;

  static std::size_t piece_of(std::int32_t index) { return static_cast<std::size_t>(index) / kPiece; }
  static std::size_t place_of(std::int32_t index) { return static_cast<std::size_t>(index) % kPiece; }

  std::vector<std::unique_ptr<Piece>> pieces_;
  std::size_t used_ = 0;  ///< those given back included
  std::vector<std::int32_t> free_;
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

  /// Adds points (map frame) with their intensities (same size).
  void insert(const std::vector<Eigen::Vector3d>& points, const std::vector<float>& intensities);

  /// The finest cell around `point` that is a plane; nullptr when there is none. With `wide` also the planes
  /// of the neighbouring coarsest cells, the nearest to the point.
  const Cell* find_plane(const Eigen::Vector3d& point, bool wide) const;

  /// The finest cell around `point` that is a line; nullptr when there is none.
  const Cell* find_line(const Eigen::Vector3d& point) const;

  /// The finest cell around `point` that has an intensity gradient; nullptr when there is none.
  const Cell* find_texture(const Eigen::Vector3d& point) const;

  /// Forgets blocks that are farther than `radius_m` from `center`, and cells that 600 insertions ago had too
  /// few points to be used and have got none since: of moving objects, noise and far surfaces there are
  /// always new ones, and their number would grow with the hours.
  void tidy(const Eigen::Vector3d& center, double radius_m);

  /// Finest cells that hold a point.
  std::vector<const Cell*> finest_cells() const;

  std::size_t cell_count() const { return cells_.size(); }
  bool empty() const { return blocks_.empty(); }

 private:
  static constexpr int kCellsPerBlock = 1 + 8 + 64;
  using Key = std::uint64_t;

  struct Block {
    std::array<std::int32_t, kCellsPerBlock> cells;
  };
  struct Address {
    Key key;
    std::array<int, 3> slots;  ///< coarsest, middle, finest
  };
  struct KeyHash {
    std::size_t operator()(Key key) const;
  };

  Address address_of(const Eigen::Vector3d& point) const;
  Key key_of(const Eigen::Vector3d& point) const;
  Cell* cell_at(Block* block, int slot);
  void update_axes(Cell* cell, double size_m) const;
  bool is_forgotten(const Cell& cell) const;
  template <typename Accept>
  const Cell* find_finest(const Eigen::Vector3d& point, const Accept& accept) const;

  VoxelMapConfig config_;
  double block_size_m_;
  std::unordered_map<Key, Block, KeyHash> blocks_;
  CellPool cells_;
  std::uint32_t scans_ = 0;  ///< insertions so far
};

}  // namespace fdi_lio::mapping
