#include "fdi_lio/mapping/brightness_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>
#include <utility>

#include <Eigen/LU>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/common/wide_vectors.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr float kReachM = 40.0F;            ///< level distance of the points that are used
constexpr std::size_t kMostPoints = 10000;  ///< of a scan
constexpr float kColumnM = 1.0F;
constexpr double kRangeStep = 0.08;  ///< of the logarithm of ranges with one mean brightness
constexpr float kStandingM = 0.35F;  ///< columns higher than this stand
constexpr float kCellM = 0.5F;
constexpr float kBlockM = 4.0F;
constexpr int kBlocksAcross = static_cast<int>(2.0F * kReachM / kBlockM);
constexpr std::size_t kColumns = static_cast<std::size_t>(kBlocksAcross) * kBlocksAcross;
constexpr std::size_t kBlocks = 2 * kColumns;  ///< what lies, then what stands
/// Of a vote: what stands may drive.
constexpr double kStandingWeight = 0.4;
constexpr std::size_t kLeastCells = 8;  ///< that a block must have compared to say something
constexpr double kNoise = 0.02;         ///< variance of a detail by noise
constexpr double kMaxSpeed = 45.0;
constexpr double kCoarseStep = 3.0;  ///< [m/s]
constexpr double kFirstStep = 2.0;   ///< of the search about a candidate [m/s]
constexpr double kLastStep = 0.5;
constexpr int kHillSteps = 5;  ///< to each side of the velocity found
constexpr double kHillStep = 0.4;
constexpr int kMostMoves = 4;          ///< of each size
constexpr double kSameVelocity = 3.0;  ///< below, two velocities are one
constexpr std::size_t kFinalists = 6;
constexpr double kBeamStep = M_PI / 180.0;  ///< azimuth of points that are taken for one direction
/// So many points with a mean of zero are added to the mean of a direction, which is of few points.
constexpr double kFixedPrior = 3.0;
constexpr float kSilent = std::numeric_limits<float>::quiet_NaN();

struct Depth {
  std::size_t stride;    ///< of the points
  std::size_t farthest;  ///< scans apart that are compared
};
constexpr Depth kCoarse = {4, 4};
constexpr Depth kFine = {1, 6};

/// What each block says of a velocity; NaN where it compared too little.
using BlockFits = std::array<float, kBlocks>;

struct Hypothesis {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  BlockFits fits{};
  double score = 0.0;
};

/// What is asked of the points of a scan, so that several are moved at a time.
struct Lanes {
  std::vector<float> x;
  std::vector<float> y;
  std::vector<float> z;
  std::vector<float> time_s;
  std::vector<float> detail;
  std::vector<std::uint32_t> stands;

  std::size_t size() const { return x.size(); }
};

struct LaneScan {
  double time_s = 0.0;  ///< since the first scan
  Eigen::Vector3d gained_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d gained_m = Eigen::Vector3d::Zero();
  Lanes lanes;
};

constexpr std::uint32_t kAcrossBits = 11;  ///< 1 km of cells, then they begin again
constexpr std::uint32_t kAcrossMask = (1U << kAcrossBits) - 1U;

FDI_LIO_INLINE std::int32_t floor_of(float value) {
  const auto towards_zero = static_cast<std::int32_t>(value);
  return towards_zero - (static_cast<float>(towards_zero) > value ? 1 : 0);
}

/// The cell of each point. What lies in a cell is not compared with what stands in it.
FDI_LIO_WIDE_VECTORS void find_keys(const Lanes& lanes, const Eigen::Vector3f& velocity,
                                    const Eigen::Vector3f& sensor, std::uint32_t* keys) {
  const std::size_t size = lanes.size();
  const float* x = lanes.x.data();
  const float* y = lanes.y.data();
  const float* z = lanes.z.data();
  const float* time_s = lanes.time_s.data();
  const std::uint32_t* stands = lanes.stands.data();
  const float velocity_x = velocity.x();
  const float velocity_y = velocity.y();
  const float velocity_z = velocity.z();
  const float sensor_x = sensor.x();
  const float sensor_y = sensor.y();
  const float sensor_z = sensor.z();
  for (std::size_t k = 0; k < size; ++k) {
    const std::int32_t column = floor_of((sensor_x + (x[k] + time_s[k] * velocity_x)) / kCellM);
    const std::int32_t row = floor_of((sensor_y + (y[k] + time_s[k] * velocity_y)) / kCellM);
    const std::int32_t layer = floor_of((sensor_z + (z[k] + time_s[k] * velocity_z)) / kCellM);
    keys[k] = (static_cast<std::uint32_t>(column) & kAcrossMask) |
              (static_cast<std::uint32_t>(row) & kAcrossMask) << kAcrossBits |
              (2U * static_cast<std::uint32_t>(layer) + stands[k]) << (2U * kAcrossBits);
  }
}

/// Every so many points of the scans.
std::vector<LaneScan> lanes_of(const std::vector<BrightScan>& scans, std::size_t stride) {
  std::vector<LaneScan> result;
  for (const BrightScan& scan : scans) {
    LaneScan lane_scan = {
        seconds_between(scans.front().stamp, scan.stamp), scan.gained_mps, scan.gained_m, {}};
    Lanes& lanes = lane_scan.lanes;
    for (std::size_t k = 0; k < scan.points.size(); k += stride) {
      const BrightPoint& point = scan.points[k];
      lanes.x.push_back(point.position.x());
      lanes.y.push_back(point.position.y());
      lanes.z.push_back(point.position.z());
      lanes.time_s.push_back(point.time_s);
      lanes.detail.push_back(point.detail);
      lanes.stands.push_back(point.stands ? 1U : 0U);
    }
    result.push_back(std::move(lane_scan));
  }
  return result;
}

/// Means of the details in cells, of some scans under one velocity. Hundreds of velocities are tried: cells
/// are found by their column of the level plane, in a table that is small enough to stay in the cache, and
/// what the scans say of a cell is chained from the newest to the oldest.
class DetailCells {
 public:
  void clear() {
    for (const Cell& cell : cells_) newest_of_[column_of(cell.key)] = kNone;
    cells_.clear();
    means_.clear();
  }

  /// The scans from the oldest to the newest, each with a number of its own. `velocity` at the scan, `sensor`
  /// where it was then.
  void add(const Lanes& lanes, std::uint16_t number, const Eigen::Vector3f& velocity,
           const Eigen::Vector3f& sensor) {
    keys_.resize(lanes.size());
    find_keys(lanes, velocity, sensor, keys_.data());
    const std::size_t first = means_.size();
    std::uint32_t in = kNone;  // the mean of the last point's cell
    for (std::size_t k = 0; k < lanes.size(); ++k) {
      if (k == 0 || keys_[k] != keys_[k - 1]) {
        std::uint32_t& newest = cell_at(keys_[k]).newest_mean;
        if (newest == kNone || newest < first) {
          const std::uint32_t older = newest;
          newest = static_cast<std::uint32_t>(means_.size());
          means_.push_back({0.0F, 0, number, block_of(lanes, k, velocity), older});
        }
        in = newest;
      }
      means_[in].detail += lanes.detail[k];
      ++means_[in].count;
    }
    for (std::size_t k = first; k < means_.size(); ++k)
      means_[k].detail /= static_cast<float>(means_[k].count);
  }

  /// By the blocks of the older of two scans.
  BlockFits fits(std::size_t farthest) const {
    std::array<float, kBlocks> squares{};
    std::array<std::uint32_t, kBlocks> counts{};
    for (const CellMean& newer : means_) {
      for (std::uint32_t k = newer.older; k != kNone; k = means_[k].older) {
        const CellMean& older = means_[k];
        if (older.scan + farthest < newer.scan) break;
        if (older.block >= kBlocks) continue;
        const float difference = newer.detail - older.detail;
        squares[older.block] += difference * difference;
        ++counts[older.block];
      }
    }
    BlockFits result;
    result.fill(kSilent);
    for (std::size_t b = 0; b < kBlocks; ++b) {
      if (counts[b] < kLeastCells) continue;
      const double mean = static_cast<double>(squares[b]) / static_cast<double>(counts[b]);
      result[b] = static_cast<float>(-0.5 * std::log(mean + kNoise));
    }
    return result;
  }

 private:
  static constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  static constexpr std::uint32_t kTableBits = 8;  ///< 128 m: farther apart, columns share an entry

  struct Cell {
    std::uint32_t key;
    std::uint32_t next;  ///< cell of the same column
    std::uint32_t newest_mean;
  };

  struct CellMean {
    float detail;
    std::uint16_t count;
    std::uint16_t scan;
    std::uint16_t block;
    std::uint32_t older;  ///< mean of the same cell
  };

  static std::uint32_t column_of(std::uint32_t key) {
    constexpr std::uint32_t kMask = (1U << kTableBits) - 1U;
    return ((key >> kAcrossBits & kMask) << kTableBits) | (key & kMask);
  }

  Cell& cell_at(std::uint32_t key) {
    std::uint32_t& newest = newest_of_[column_of(key)];
    for (std::uint32_t k = newest; k != kNone; k = cells_[k].next) {
      if (cells_[k].key == key) return cells_[k];
    }
    cells_.push_back({key, newest, kNone});
    newest = static_cast<std::uint32_t>(cells_.size() - 1);
    return cells_.back();
  }

  static std::uint16_t block_of(const Lanes& lanes, std::size_t k, const Eigen::Vector3f& velocity) {
    const std::int32_t x = floor_of((lanes.x[k] + lanes.time_s[k] * velocity.x() + kReachM) / kBlockM);
    const std::int32_t y = floor_of((lanes.y[k] + lanes.time_s[k] * velocity.y() + kReachM) / kBlockM);
    if (x < 0 || y < 0 || x >= kBlocksAcross || y >= kBlocksAcross) return kBlocks;
    return static_cast<std::uint16_t>((lanes.stands[k] != 0 ? kColumns : 0U) +
                                      static_cast<std::size_t>(y * kBlocksAcross + x));
  }

  std::vector<std::uint32_t> keys_;
  std::vector<std::uint32_t> newest_of_ = std::vector<std::uint32_t>(1U << (2U * kTableBits), kNone);
  std::vector<Cell> cells_;
  std::vector<CellMean> means_;
};

BlockFits fits_of(const std::vector<LaneScan>& scans, const Eigen::Vector3d& velocity, std::size_t farthest,
                  DetailCells* cells) {
  cells->clear();
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const Eigen::Vector3d now = velocity + scans[k].gained_mps;
    const Eigen::Vector3d sensor = scans[k].time_s * velocity + scans[k].gained_m;
    cells->add(scans[k].lanes, static_cast<std::uint16_t>(k), now.cast<float>(), sensor.cast<float>());
  }
  return cells->fits(farthest);
}

/// What a block says of the usual velocity.
BlockFits medians(const std::vector<Hypothesis>& all) {
  BlockFits result;
  std::vector<float> values;
  for (std::size_t b = 0; b < kBlocks; ++b) {
    values.clear();
    for (const Hypothesis& hypothesis : all) {
      if (!std::isnan(hypothesis.fits[b])) values.push_back(hypothesis.fits[b]);
    }
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    result[b] = values.empty() ? kSilent : *middle;
  }
  return result;
}

double votes(const BlockFits& one, const BlockFits& other) {
  double sum = 0.0;
  for (std::size_t b = 0; b < kBlocks; ++b) {
    if (std::isnan(one[b]) || std::isnan(other[b])) continue;
    const double weight = b < kColumns ? 1.0 : kStandingWeight;
    sum += weight * std::clamp(static_cast<double>(one[b]) - static_cast<double>(other[b]), -1.0, 1.0);
  }
  return sum;
}

bool is_same(const Eigen::Vector3d& one, const Eigen::Vector3d& other) {
  return (one - other).norm() <= kSameVelocity;
}

std::vector<Eigen::Vector3d> level_velocities() {
  std::vector<Eigen::Vector3d> result;
  const int steps = static_cast<int>(kMaxSpeed / kCoarseStep);
  for (int x = -steps; x <= steps; ++x) {
    for (int y = -steps; y <= steps; ++y) {
      const Eigen::Vector3d velocity(x * kCoarseStep, y * kCoarseStep, 0.0);
      if (velocity.norm() <= kMaxSpeed) result.push_back(velocity);
    }
  }
  return result;
}

std::vector<Hypothesis> coarse_hypotheses(const std::vector<BrightScan>& scans) {
  const std::vector<LaneScan> lanes = lanes_of(scans, kCoarse.stride);
  const std::vector<Eigen::Vector3d> velocities = level_velocities();
  std::vector<Hypothesis> result(velocities.size());
  constexpr std::size_t kChunk = 16;
  parallel_chunks(velocities.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
    DetailCells cells;
    for (std::size_t k = begin; k < end; ++k) {
      result[k].velocity = velocities[k];
      result[k].fits = fits_of(lanes, velocities[k], kCoarse.farthest, &cells);
    }
  });
  return result;
}

/// The best velocity near by, in smaller and smaller steps.
Hypothesis climbed(const std::vector<LaneScan>& scans, const Eigen::Vector3d& from, const BlockFits& usual) {
  DetailCells cells;
  const auto at = [&](const Eigen::Vector3d& velocity) {
    Hypothesis hypothesis;
    hypothesis.velocity = velocity;
    hypothesis.fits = fits_of(scans, velocity, kFine.farthest, &cells);
    hypothesis.score = votes(hypothesis.fits, usual);
    return hypothesis;
  };
  Hypothesis best = at(from);
  Eigen::Vector3d middle = from;
  for (double step = kFirstStep; step >= kLastStep; step *= 0.5) {
    for (int move = 0; move < kMostMoves; ++move) {
      const Eigen::Vector3d before = middle;
      middle = best.velocity;
      for (int axis = 0; axis < 2; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
          const Eigen::Vector3d velocity = middle + sign * step * Eigen::Vector3d::Unit(axis);
          if (velocity.isApprox(before)) continue;  // where the last move came from
          Hypothesis next = at(velocity);
          if (next.score > best.score) best = next;
        }
      }
      if (best.velocity == middle) break;
    }
  }
  return best;
}

/// The middle of the hill of votes, whose top is ragged by the cells: of a parabola through what velocities
/// about it get, along each axis.
Eigen::Vector3d refined(const std::vector<LaneScan>& scans, const Eigen::Vector3d& top,
                        const BlockFits& usual) {
  Eigen::Vector3d velocity = top;
  std::array<double, 2 * kHillSteps + 1> heights{};
  for (int axis = 0; axis < 2; ++axis) {
    parallel_chunks(heights.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
      DetailCells cells;
      const double offset = kHillStep * (static_cast<double>(k) - kHillSteps);
      const Eigen::Vector3d at = velocity + offset * Eigen::Vector3d::Unit(axis);
      heights[k] = votes(fits_of(scans, at, kFine.farthest, &cells), usual);
    });
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < heights.size(); ++k) {
      const double offset = kHillStep * (static_cast<double>(k) - kHillSteps);
      const Eigen::Vector3d powers(1.0, offset, offset * offset);
      H += powers * powers.transpose();
      b += heights[k] * powers;
    }
    const Eigen::Vector3d parabola = H.inverse() * b;
    if (parabola.z() >= 0.0) continue;
    const double middle = -0.5 * parabola.y() / parabola.z();
    if (std::abs(middle) <= kHillSteps * kHillStep) velocity[axis] += middle;
  }
  return velocity;
}

/// The best that differ, and the known one.
std::vector<Eigen::Vector3d> finalists(std::vector<Hypothesis> all, const Eigen::Vector3d& known) {
  std::stable_sort(all.begin(), all.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
  std::vector<Eigen::Vector3d> chosen = {known};
  for (const Hypothesis& hypothesis : all) {
    if (chosen.size() > kFinalists) break;
    const bool is_new = std::none_of(chosen.begin(), chosen.end(), [&](const Eigen::Vector3d& v) {
      return is_same(v, hypothesis.velocity);
    });
    if (is_new) chosen.push_back(hypothesis.velocity);
  }
  return chosen;
}

/// Finds out which points stand on others or under them, rather than lying in a flat column.
void find_standing(std::vector<BrightPoint>* points) {
  std::unordered_map<std::uint64_t, std::pair<float, float>> columns;
  const auto column_of = [](const Eigen::Vector3f& p) {
    return key_of(cell_of(Eigen::Vector3f(p.x(), p.y(), 0.0F) / kColumnM));
  };
  for (const BrightPoint& point : *points) {
    const float z = point.position.z();
    auto& [lowest, highest] = columns.try_emplace(column_of(point.position), z, z).first->second;
    lowest = std::min(lowest, z);
    highest = std::max(highest, z);
  }
  for (BrightPoint& point : *points) {
    const auto& [lowest, highest] = columns.at(column_of(point.position));
    point.stands = highest - lowest > kStandingM;
  }
}

/// Takes out of the details their mean over each group. The details of a group that lies flat do not count
/// for what stands in it, or the other way round. `prior`: so many more members with a detail of zero.
void subtract_means(const std::vector<BrightPoint*>& points, const std::vector<std::size_t>& groups,
                    double prior) {
  struct Sum {
    double sum = 0.0;
    double count = 0.0;
  };
  std::vector<Sum> sums(2 * (1 + *std::max_element(groups.begin(), groups.end())));
  const auto sum_of = [&](std::size_t k) -> Sum& {
    return sums[2 * groups[k] + (points[k]->stands ? 1 : 0)];
  };
  for (std::size_t k = 0; k < points.size(); ++k) {
    sum_of(k).sum += static_cast<double>(points[k]->detail);
    sum_of(k).count += 1.0;
  }
  for (std::size_t k = 0; k < points.size(); ++k)
    points[k]->detail -= static_cast<float>(sum_of(k).sum / (sum_of(k).count + prior));
}

/// What stays in the same direction from the sensor says nothing of its motion, but looks at rest beside it.
void subtract_fixed(std::vector<BrightScan>* scans) {
  const auto columns = static_cast<std::size_t>(2.0 * M_PI / kBeamStep) + 2;
  std::vector<BrightPoint*> points;
  std::vector<std::size_t> beams;
  for (BrightScan& scan : *scans) {
    for (BrightPoint& point : scan.points) {
      const Eigen::Vector3d seen = scan.R_level_lidar.transpose() * point.position.cast<double>();
      const auto column = static_cast<std::size_t>((std::atan2(seen.y(), seen.x()) + M_PI) / kBeamStep);
      points.push_back(&point);
      beams.push_back(point.ring * columns + column);
    }
  }
  if (!points.empty()) subtract_means(points, beams, kFixedPrior);
}

}  // namespace

BrightScan bright_scan(const FeatureSet& features, const Eigen::Matrix3d& R_level_lidar,
                       const Eigen::Vector3d& v_deskew) {
  std::vector<BrightPoint> all;
  for (const std::vector<Point>* list : {&features.planes, &features.edges}) {
    for (const Point& point : *list) {
      const Eigen::Vector3d deskewed = R_level_lidar * point.position.cast<double>();
      BrightPoint seen;
      seen.position = (deskewed - static_cast<double>(point.time_s) * v_deskew).cast<float>();
      if (seen.position.head<2>().norm() > kReachM) continue;
      seen.time_s = point.time_s;
      seen.detail = std::log1p(std::max(0.0F, point.intensity));
      seen.ring = point.ring;
      all.push_back(seen);
    }
  }
  find_standing(&all);
  std::vector<BrightPoint*> points;
  std::vector<std::size_t> ranges;
  std::vector<std::size_t> rings;
  for (BrightPoint& point : all) {
    const double range_m = std::max(1.0, static_cast<double>(point.position.norm()));
    points.push_back(&point);
    ranges.push_back(static_cast<std::size_t>(std::log(range_m) / kRangeStep));
    rings.push_back(point.ring);
  }
  if (!points.empty()) {
    subtract_means(points, ranges, 0.0);
    subtract_means(points, rings, 0.0);
  }

  BrightScan result;
  result.stamp = features.stamp;
  result.R_level_lidar = R_level_lidar;
  const std::size_t count = std::min(kMostPoints, all.size());
  for (std::size_t k = 0; k < count; ++k) result.points.push_back(all[k * all.size() / count]);
  // Side by side in space under any velocity, more or less: the cells of one are then those of the next.
  std::stable_sort(result.points.begin(), result.points.end(),
                   [](const BrightPoint& a, const BrightPoint& b) {
                     const std::int64_t row_a = cell_of(a.position / kCellM).y();
                     const std::int64_t row_b = cell_of(b.position / kCellM).y();
                     return row_a != row_b ? row_a < row_b : a.position.x() < b.position.x();
                   });
  return result;
}

BrightnessMotion find_brightness_motion(std::vector<BrightScan> scans, const Eigen::Vector3d& known_way) {
  subtract_fixed(&scans);
  const double time_s = std::max(1e-3, seconds_between(scans.front().stamp, scans.back().stamp));
  const Eigen::Vector3d known_velocity = (known_way - scans.back().gained_m) / time_s;
  std::vector<Hypothesis> coarse = coarse_hypotheses(scans);
  const BlockFits usual = medians(coarse);
  for (Hypothesis& hypothesis : coarse) hypothesis.score = votes(hypothesis.fits, usual);

  const std::vector<Eigen::Vector3d> chosen = finalists(std::move(coarse), known_velocity);
  const std::vector<LaneScan> lanes = lanes_of(scans, kFine.stride);
  std::vector<Hypothesis> best(chosen.size());
  parallel_chunks(chosen.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
    best[k] = climbed(lanes, chosen[k], usual);
  });
  BrightnessMotion motion;
  motion.lead = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& one : best) {
    double lead = std::numeric_limits<double>::infinity();
    for (const Hypothesis& other : best) {
      if (!is_same(one.velocity, other.velocity)) lead = std::min(lead, votes(one.fits, other.fits));
    }
    if (lead > motion.lead) motion = {one.velocity, lead, is_same(one.velocity, known_velocity)};
  }
  motion.velocity = refined(lanes, motion.velocity, usual);
  return motion;
}

}  // namespace fdi_lio::mapping
