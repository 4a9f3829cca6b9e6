#include "fdi_lio/matching/voxel_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include <Eigen/Eigenvalues>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/matching/beam_motions.hpp"

namespace fdi_lio::matching {

namespace {

constexpr std::int64_t kKeyOffset = 1 << 20;  ///< 21 bits a coordinate: +-1 million blocks
constexpr std::uint32_t kRememberedScans = 600;
/// Points that are inserted, or looked up, side by side: memory is asked for before it is needed.
constexpr std::size_t kGroup = 16;
/// The axes are computed again when the points have grown by this share: they change little in between.
constexpr double kGrowth = 1.25;
/// A plane is at least this much thinner than wide, and this wide in both directions as a share of the cell.
constexpr double kMaxFlatness = 0.1;
constexpr double kMinSpread = 0.12;
/// An intensity gradient counts when it exceeds so many standard deviations of its own error.
constexpr double kGradientSignificance = 4.0;
/// What is believed of the deviation of intensities in a cell before its own points say more, and how many
/// points that belief is worth: a handful of points that agree by chance must not count for certain.
constexpr double kPriorIntensityVariance = 0.15 * 0.15;
constexpr double kPriorIntensityPoints = 10.0;
constexpr double kBeamStep = 6e-3;  ///< of elevation [rad]: beams are at least 0.33 degrees apart

int level_of(int slot) { return slot == 0 ? 2 : (slot < 9 ? 1 : 0); }

/// Linear regression of the intensity on the two coordinates in the surface; whether there is a gradient.
bool regress_intensity(double least_spread_m, Cell* cell) {
  cell->intensity_gradient.setZero();
  bool is_textured = false;
  const double freedom = cell->count - 1.0;
  double slopes[3] = {0.0, 0.0, 0.0};
  double left = cell->intensity_scatter;
  for (int axis = 1; axis < 3; ++axis) {
    if (cell->variances[axis] < least_spread_m * least_spread_m) continue;
    slopes[axis] = cell->axes.col(axis).dot(cell->cross_scatter) / (freedom * cell->variances[axis]);
    left -= slopes[axis] * slopes[axis] * freedom * cell->variances[axis];
  }
  cell->intensity_variance = (kPriorIntensityPoints * kPriorIntensityVariance + std::max(0.0, left)) /
                             (kPriorIntensityPoints + freedom - 2.0);
  for (int axis = 1; axis < 3; ++axis) {
    const double slope_variance = cell->intensity_variance / (freedom * cell->variances[axis]);
    if (slopes[axis] * slopes[axis] < kGradientSignificance * kGradientSignificance * slope_variance)
      continue;
    cell->intensity_gradient += slopes[axis] * cell->axes.col(axis);
    is_textured = true;
  }
  return is_textured;
}

/// std::floor is a call on the plainest x86-64.
std::int64_t floor_of(double value) {
  const auto cut = static_cast<std::int64_t>(value);
  return value < static_cast<double>(cut) ? cut - 1 : cut;
}

/// Of the sine of the elevation.
std::uint64_t beam_bit(double sine) {
  const double elevation = std::asin(std::clamp(sine, -1.0, 1.0));
  const auto step = static_cast<std::uint64_t>((elevation + M_PI_2) / kBeamStep);
  return std::uint64_t{1} << (step % 64);
}

}  // namespace

/// A point with its intensity, the unit vector from the sensor to it, what it moves by with the elevation of
/// its beam, and that elevation (Cell::beams).
struct VoxelMap::Sighting {
  Eigen::Vector3d point;
  float intensity;
  Eigen::Vector3d direction;
  Eigen::Vector3d lever;
  std::uint64_t beam;

  void add_to(Cell* cell) const;
};

/// Welford's update, exact for the mean and the scatter about it.
void VoxelMap::Sighting::add_to(Cell* cell) const {
  ++cell->count;
  cell->beams |= beam;
  cell->view += (direction - cell->view) / cell->count;
  cell->lever += (lever - cell->lever) / cell->count;
  const Eigen::Vector3d before = point - cell->mean;
  cell->mean += before / cell->count;
  cell->scatter += before * (point - cell->mean).transpose();
  const float intensity_before = intensity - cell->mean_intensity;
  cell->mean_intensity += intensity_before / static_cast<float>(cell->count);
  const double intensity_after = intensity - cell->mean_intensity;
  cell->intensity_scatter += intensity_before * intensity_after;
  cell->cross_scatter += before * intensity_after;
}

/// A cell whose axes have to be computed again.
struct VoxelMap::Dirty {
  std::uint32_t cell;
  int level;
  CellReference* reference;
};

VoxelMap::VoxelMap(const VoxelMapConfig& config)
    : config_(config), block_size_m_(4.0 * config.voxel_size_m), blocks_per_m_(1.0 / block_size_m_) {}

VoxelMap::Address VoxelMap::address_of(const Eigen::Vector3d& point) const {
  Address address{0, {0, 1, 9}};
  for (int axis = 0; axis < 3; ++axis) {
    const double scaled = point[axis] * blocks_per_m_;
    const std::int64_t index = floor_of(scaled);
    address.key = (address.key << 21) | (static_cast<Key>(index + kKeyOffset) & 0x1fffff);
    const int fine = std::clamp(static_cast<int>((scaled - static_cast<double>(index)) * 4.0), 0, 3);
    address.slots[1] += (fine / 2) << axis;
    address.slots[2] += fine << (2 * axis);
  }
  return address;
}

Eigen::Vector3d VoxelMap::center_of(const Block& block) const {
  Eigen::Vector3d center;
  for (int axis = 0; axis < 3; ++axis) {
    const auto index = static_cast<std::int64_t>((block.key >> (21 * (2 - axis))) & 0x1fffff) - kKeyOffset;
    center[axis] = (static_cast<double>(index) + 0.5) * block_size_m_;
  }
  return center;
}

VoxelMap::Block* VoxelMap::block_at(Key key) {
  std::uint32_t number = index_.find(key);
  if (number == KeyIndex::kNone) {
    number = index_.find_or_add(key, blocks_.take());
    blocks_[number].key = key;
    blocks_[number].tidy_at = scans_ + kRememberedScans + 1;
  }
  return &blocks_[number];
}

void VoxelMap::insert(const std::vector<Eigen::Vector3d>& points, const std::vector<float>& intensities,
                      const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Vector3d origin = T_map_lidar.translation();
  const Eigen::Vector3d spin_axis = T_map_lidar.linear().col(2);
  std::vector<Dirty> dirty;
  ++scans_;
  std::array<Address, kGroup> addresses;
  std::array<Block*, kGroup> blocks{};
  for (std::size_t first = 0; first < points.size(); first += kGroup) {
    const std::size_t size = std::min(kGroup, points.size() - first);
    for (std::size_t k = 0; k < size; ++k) {
      addresses[k] = address_of(points[first + k]);
      index_.prefetch(addresses[k].key);
    }
    for (std::size_t k = 0; k < size; ++k) {
      blocks[k] = block_at(addresses[k].key);
      for (const int slot : addresses[k].slots) __builtin_prefetch(&blocks[k]->cells[slot], 1);
    }
    for (std::size_t k = 0; k < size; ++k) {
      for (const int slot : addresses[k].slots) {
        CellReference& reference = blocks[k]->cells[slot];
        if (reference.is_empty()) reference.set(cells_.take(), 0);
        const Cell& cell = cells_[reference.cell()];
        __builtin_prefetch(&cell.mean, 1);
        __builtin_prefetch(&cell.scatter, 1);
        __builtin_prefetch(&cell.mean_intensity, 1);
      }
    }
    for (std::size_t k = 0; k < size; ++k) {
      const Eigen::Vector3d& point = points[first + k];
      const Eigen::Vector3d direction = (point - origin).normalized();
      const Sighting sighting{point, intensities[first + k], direction,
                              beam_motions(point - origin, spin_axis).col(1),
                              beam_bit(direction.dot(spin_axis))};
      for (const int slot : addresses[k].slots) add(sighting, slot, &blocks[k]->cells[slot], &dirty);
    }
  }
  parallel_chunks(dirty.size(), 256, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      update_axes(config_.voxel_size_m * (1 << dirty[i].level), dirty[i].reference);
    }
  });
}

void VoxelMap::add(const Sighting& sighting, int slot, CellReference* reference, std::vector<Dirty>* dirty) {
  Cell* cell = &cells_[reference->cell()];
  // Scans count in full cells, too: one that fills early would never have a texture.
  bool has_enough_scans = false;
  if (cell->newest_scan != scans_) {
    cell->newest_scan = scans_;
    has_enough_scans = ++cell->scans == config_.min_scans && config_.with_texture;
  }
  const bool is_full = cell->count >= config_.max_points;
  if (is_full && !has_enough_scans) return;
  if (!is_full) sighting.add_to(cell);
  if (cell->count < config_.min_points) return;
  if (has_enough_scans || cell->count_at_update == 0 || cell->count >= kGrowth * cell->count_at_update) {
    cell->count_at_update = cell->count;
    if (cell->listed_at == scans_) return;  // no two threads may share it
    cell->listed_at = scans_;
    dirty->push_back({reference->cell(), level_of(slot), reference});
  }
}

void VoxelMap::update_axes(double size_m, CellReference* reference) {
  Cell* cell = &cells_[reference->cell()];
  const Eigen::Matrix3d scatter = 0.5 * (cell->scatter + cell->scatter.transpose());
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(scatter / (cell->count - 1.0));
  cell->axes = solver.eigenvectors();
  cell->variances = solver.eigenvalues().cwiseMax(0.0);
  const double thickness_sq = config_.max_thickness_m * config_.max_thickness_m;
  const double spread_sq = kMinSpread * kMinSpread * size_m * size_m;
  const bool is_thin = cell->variances[0] < thickness_sq;
  const bool is_narrow = cell->variances[1] < thickness_sq;
  const bool is_plane =
      is_thin && cell->variances[0] < kMaxFlatness * cell->variances[1] && cell->variances[1] > spread_sq;
  const bool is_line =
      is_narrow && cell->variances[1] < kMaxFlatness * cell->variances[2] && cell->variances[2] > spread_sq;
  // In a cell that has become too thick to find another one, the gradient of before stays.
  bool is_textured = reference->is(CellReference::kTexture);
  if (config_.with_texture && cell->scans >= config_.min_scans && is_thin)
    is_textured = regress_intensity(kMinSpread * size_m, cell);
  reference->set(reference->cell(), (is_plane ? CellReference::kPlane : 0U) |
                                        (is_line ? CellReference::kLine : 0U) |
                                        (is_textured ? CellReference::kTexture : 0U));
}

void VoxelMap::find_finest(const Eigen::Vector3d* points, std::size_t count, CellReference::Kind kind,
                           const Cell** cells) const {
  std::array<Address, kGroup> addresses;
  std::array<const Block*, kGroup> blocks{};
  for (std::size_t first = 0; first < count; first += kGroup) {
    const std::size_t size = std::min(kGroup, count - first);
    for (std::size_t k = 0; k < size; ++k) {
      addresses[k] = address_of(points[first + k]);
      index_.prefetch(addresses[k].key);
    }
    for (std::size_t k = 0; k < size; ++k) {
      const std::uint32_t number = index_.find(addresses[k].key);
      blocks[k] = number == KeyIndex::kNone ? nullptr : &blocks_[number];
      if (blocks[k] == nullptr) continue;
      for (const int slot : addresses[k].slots) __builtin_prefetch(&blocks[k]->cells[slot]);
    }
    for (std::size_t k = 0; k < size; ++k) {
      const Cell*& cell = cells[first + k];
      cell = nullptr;
      if (blocks[k] == nullptr) continue;
      for (int level = 2; level >= 0 && cell == nullptr; --level) {
        const CellReference reference = blocks[k]->cells[addresses[k].slots[level]];
        if (reference.is(kind)) cell = &cells_[reference.cell()];
      }
      if (cell == nullptr) continue;
      __builtin_prefetch(&cell->mean);
      __builtin_prefetch(&cell->variances);
      __builtin_prefetch(&cell->axes(0, 1));
      __builtin_prefetch(&cell->view);
      if (kind == CellReference::kTexture) __builtin_prefetch(&cell->intensity_gradient);
    }
  }
}

const Cell* VoxelMap::find_wide_plane(const Eigen::Vector3d& point) const {
  const Cell* nearest = nullptr;
  double nearest_sq = std::numeric_limits<double>::max();
  for (int neighbour = 0; neighbour < 27; ++neighbour) {
    const Eigen::Vector3d offset(neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1);
    const std::uint32_t other = index_.find(address_of(point + block_size_m_ * offset).key);
    if (other == KeyIndex::kNone || !blocks_[other].cells[0].is(CellReference::kPlane)) continue;
    const Cell& cell = cells_[blocks_[other].cells[0].cell()];
    const double distance_sq = (cell.mean - point).squaredNorm();
    if (distance_sq >= nearest_sq) continue;
    nearest = &cell;
    nearest_sq = distance_sq;
  }
  return nearest;
}

void VoxelMap::find_planes(const Eigen::Vector3d* points, std::size_t count, bool wide,
                           const Cell** cells) const {
  find_finest(points, count, CellReference::kPlane, cells);
  if (!wide) return;
  for (std::size_t i = 0; i < count; ++i) {
    if (cells[i] == nullptr) cells[i] = find_wide_plane(points[i]);
  }
}

void VoxelMap::find_lines(const Eigen::Vector3d* points, std::size_t count, const Cell** cells) const {
  find_finest(points, count, CellReference::kLine, cells);
}

void VoxelMap::find_textures(const Eigen::Vector3d* points, std::size_t count, const Cell** cells) const {
  find_finest(points, count, CellReference::kTexture, cells);
}

const Cell* VoxelMap::find_plane(const Eigen::Vector3d& point, bool wide) const {
  const Cell* cell = nullptr;
  find_planes(&point, 1, wide, &cell);
  return cell;
}

bool VoxelMap::is_forgotten(const Cell& cell) const {
  return cell.count < config_.min_points && scans_ - cell.newest_scan > kRememberedScans;
}

/// By the mean of the points, which is somewhere in the block.
bool VoxelMap::has_left(const Block& block, const Eigen::Vector3d& center, double radius_m) const {
  const double distance_m = (center_of(block) - center).norm();
  if (std::abs(distance_m - radius_m) > block_size_m_) return distance_m > radius_m;
  return (cells_[block.cells[0].cell()].mean - center).squaredNorm() > radius_m * radius_m;
}

void VoxelMap::tidy(const Eigen::Vector3d& center, double radius_m) {
  for (std::uint32_t number = 0; number < blocks_.end(); ++number) {
    Block& block = blocks_[number];
    if (block.cells[0].is_empty()) continue;
    bool is_left = has_left(block, center, radius_m);
    if (!is_left && scans_ < block.tidy_at) continue;
    // The coarsest cell has the points of all others.
    is_left = is_left || is_forgotten(cells_[block.cells[0].cell()]);
    block.tidy_at = scans_ + kRememberedScans + 1;
    for (CellReference& reference : block.cells) {
      if (reference.is_empty()) continue;
      const Cell& cell = cells_[reference.cell()];
      if (is_left || is_forgotten(cell)) {
        cells_.give_back(reference.cell());
        reference = CellReference();
      } else if (cell.count < config_.min_points) {
        block.tidy_at = std::min(block.tidy_at, cell.newest_scan + kRememberedScans + 1);
      }
    }
    if (!is_left) continue;
    index_.erase(block.key);
    blocks_.give_back(number);
  }
}

std::vector<const Cell*> VoxelMap::finest_cells() const {
  std::vector<const Cell*> cells;
  for (std::uint32_t number = 0; number < blocks_.end(); ++number) {
    for (int slot = 9; slot < kCellsPerBlock; ++slot) {
      const CellReference reference = blocks_[number].cells[slot];
      if (!reference.is_empty()) cells.push_back(&cells_[reference.cell()]);
    }
  }
  return cells;
}

}  // namespace fdi_lio::matching
