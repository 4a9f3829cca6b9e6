#include "fdi_lio/mapping/voxel_map.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <Eigen/Eigenvalues>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr std::int32_t kNone = -1;
constexpr std::int64_t kKeyOffset = 1 << 20;  ///< 21 bits a coordinate: +-1 million blocks
constexpr std::uint32_t kRememberedScans = 600;
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

int level_of(int slot) { return slot == 0 ? 2 : (slot < 9 ? 1 : 0); }

/// Welford's update, exact for the mean and the scatter about it.
void add_point(const Eigen::Vector3d& point, float intensity, Cell* cell) {
  ++cell->count;
  const Eigen::Vector3d before = point - cell->mean;
  cell->mean += before / cell->count;
  cell->scatter += before * (point - cell->mean).transpose();
  const float intensity_before = intensity - cell->mean_intensity;
  cell->mean_intensity += intensity_before / static_cast<float>(cell->count);
  const double intensity_after = intensity - cell->mean_intensity;
  cell->intensity_scatter += intensity_before * intensity_after;
  cell->cross_scatter += before * intensity_after;
}

/// Linear regression of the intensity on the two coordinates in the surface.
void regress_intensity(double least_spread_m, Cell* cell) {
  cell->intensity_gradient.setZero();
  cell->is_textured = false;
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
    cell->is_textured = true;
  }
}

}  // namespace

std::int32_t CellPool::take() {
  if (!free_.empty()) {
    const std::int32_t index = free_.back();
    free_.pop_back();
    (*this)[index] = Cell();
    return index;
  }
  if (used_ == kPiece * pieces_.size()) pieces_.push_back(std::make_unique<Piece>());
  return static_cast<std::int32_t>(used_++);
}

std::size_t VoxelMap::KeyHash::operator()(Key key) const {
  key ^= key >> 31;
  key *= 0x7fb5d329728ea185ULL;
  key ^= key >> 27;
  key *= 0x81dadef4bc2dd44dULL;
  return static_cast<std::size_t>(key ^ (key >> 33));
}

VoxelMap::VoxelMap(const VoxelMapConfig& config)
    : config_(config), block_size_m_(4.0 * config.voxel_size_m) {}

VoxelMap::Key VoxelMap::key_of(const Eigen::Vector3d& point) const {
  Key key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto index = static_cast<std::int64_t>(std::floor(point[axis] / block_size_m_)) + kKeyOffset;
    key = (key << 21) | (static_cast<Key>(index) & 0x1fffff);
  }
  return key;
}

VoxelMap::Address VoxelMap::address_of(const Eigen::Vector3d& point) const {
  Address address{key_of(point), {0, 1, 9}};
  for (int axis = 0; axis < 3; ++axis) {
    const double scaled = point[axis] / block_size_m_;
    const int fine = std::clamp(static_cast<int>((scaled - std::floor(scaled)) * 4.0), 0, 3);
    address.slots[1] += (fine / 2) << axis;
    address.slots[2] += fine << (2 * axis);
  }
  return address;
}

Cell* VoxelMap::cell_at(Block* block, int slot) {
  std::int32_t& index = block->cells[slot];
  if (index == kNone) index = cells_.take();
  return &cells_[index];
}

void VoxelMap::insert(const std::vector<Eigen::Vector3d>& points, const std::vector<float>& intensities) {
  struct Dirty {
    std::int32_t cell;
    int level;
  };
  std::vector<Dirty> dirty;
  ++scans_;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Address address = address_of(points[i]);
    auto [entry, is_new] = blocks_.try_emplace(address.key);
    if (is_new) entry->second.cells.fill(kNone);
    for (const int slot : address.slots) {
      Cell* cell = cell_at(&entry->second, slot);
      // Scans count in full cells, too: one that fills early would never have a texture.
      bool has_enough_scans = false;
      if (cell->newest_scan != scans_) {
        cell->newest_scan = scans_;
        has_enough_scans = ++cell->scans == config_.min_scans && config_.with_texture;
      }
      const bool is_full = cell->count >= config_.max_points;
      if (is_full && !has_enough_scans) continue;
      if (!is_full) add_point(points[i], intensities[i], cell);
      if (cell->count < config_.min_points) continue;
      if (has_enough_scans || cell->count_at_update == 0 || cell->count >= kGrowth * cell->count_at_update) {
        cell->count_at_update = cell->count;
        dirty.push_back({entry->second.cells[slot], level_of(slot)});
      }
    }
  }
  // A cell that grew twice in one scan is listed twice: no two threads may share it.
  std::sort(dirty.begin(), dirty.end(), [](const Dirty& a, const Dirty& b) { return a.cell < b.cell; });
  const auto same_cell = [](const Dirty& a, const Dirty& b) { return a.cell == b.cell; };
  dirty.erase(std::unique(dirty.begin(), dirty.end(), same_cell), dirty.end());
  parallel_chunks(dirty.size(), 256, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      update_axes(&cells_[dirty[i].cell], config_.voxel_size_m * (1 << dirty[i].level));
    }
  });
}

void VoxelMap::update_axes(Cell* cell, double size_m) const {
  const Eigen::Matrix3d scatter = 0.5 * (cell->scatter + cell->scatter.transpose());
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(scatter / (cell->count - 1.0));
  cell->axes = solver.eigenvectors();
  cell->variances = solver.eigenvalues().cwiseMax(0.0);
  const double thickness_sq = config_.max_thickness_m * config_.max_thickness_m;
  const double spread_sq = kMinSpread * kMinSpread * size_m * size_m;
  cell->is_plane = cell->variances[0] < thickness_sq &&
                   cell->variances[0] < kMaxFlatness * cell->variances[1] && cell->variances[1] > spread_sq;
  cell->is_line = cell->variances[1] < thickness_sq &&
                  cell->variances[1] < kMaxFlatness * cell->variances[2] && cell->variances[2] > spread_sq;
  if (config_.with_texture && cell->scans >= config_.min_scans && cell->variances[0] < thickness_sq)
    regress_intensity(kMinSpread * size_m, cell);
}

template <typename Accept>
const Cell* VoxelMap::find_finest(const Eigen::Vector3d& point, const Accept& accept) const {
  const Address address = address_of(point);
  const auto block = blocks_.find(address.key);
  if (block == blocks_.end()) return nullptr;
  for (int level = 2; level >= 0; --level) {
    const std::int32_t index = block->second.cells[address.slots[level]];
    if (index != kNone && accept(cells_[index])) return &cells_[index];
  }
  return nullptr;
}

const Cell* VoxelMap::find_plane(const Eigen::Vector3d& point, bool wide) const {
  const Cell* around = find_finest(point, [](const Cell& cell) { return cell.is_plane; });
  if (around != nullptr) return around;
  if (!wide) return nullptr;
  const Cell* nearest = nullptr;
  double nearest_sq = std::numeric_limits<double>::max();
  for (int neighbour = 0; neighbour < 27; ++neighbour) {
    const Eigen::Vector3d offset(neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1);
    const auto other = blocks_.find(key_of(point + block_size_m_ * offset));
    if (other == blocks_.end() || other->second.cells[0] == kNone) continue;
    const Cell& cell = cells_[other->second.cells[0]];
    const double distance_sq = (cell.mean - point).squaredNorm();
    if (!cell.is_plane || distance_sq >= nearest_sq) continue;
    nearest = &cell;
    nearest_sq = distance_sq;
  }
  return nearest;
}

const Cell* VoxelMap::find_line(const Eigen::Vector3d& point) const {
  return find_finest(point, [](const Cell& cell) { return cell.is_line; });
}

const Cell* VoxelMap::find_texture(const Eigen::Vector3d& point) const {
  return find_finest(point, [](const Cell& cell) { return cell.is_textured; });
}

bool VoxelMap::is_forgotten(const Cell& cell) const {
  return cell.count < config_.min_points && scans_ - cell.newest_scan > kRememberedScans;
}

void VoxelMap::tidy(const Eigen::Vector3d& center, double radius_m) {
  const double radius_sq = radius_m * radius_m;
  for (auto entry = blocks_.begin(); entry != blocks_.end();) {
    // The coarsest cell has the points of all others.
    const Cell& coarsest = cells_[entry->second.cells[0]];
    const bool is_left = (coarsest.mean - center).squaredNorm() > radius_sq || is_forgotten(coarsest);
    for (std::int32_t& index : entry->second.cells) {
      if (index == kNone || !(is_left || is_forgotten(cells_[index]))) continue;
      cells_.give_back(index);
      index = kNone;
    }
    entry = is_left ? blocks_.erase(entry) : std::next(entry);
  }
}

std::vector<const Cell*> VoxelMap::finest_cells() const {
  std::vector<const Cell*> cells;
  for (const auto& entry : blocks_) {
    for (int slot = 9; slot < kCellsPerBlock; ++slot) {
      if (entry.second.cells[slot] != kNone) cells.push_back(&cells_[entry.second.cells[slot]]);
    }
  }
  return cells;
}

}  // namespace fdi_lio::mapping
