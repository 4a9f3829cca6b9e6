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

/// Means of the details in cells, of one scan under one velocity. Hundreds of velocities are tried: cells are
/// found by their column of the level plane, in a table that is small enough to stay in the cache.
class DetailCells {
 public:
  /// `velocity` at the scan, `sensor` where it was then.
  void fill(const BrightScan& scan, const Eigen::Vector3f& velocity, const Eigen::Vector3f& sensor,
            std::size_t stride) {
    for (const CellMean& cell : cells_) newest_of_[column_of(cell.x, cell.y)] = kNone;
    cells_.clear();
    for (std::size_t k = 0; k < scan.points.size(); k += stride) {
      const BrightPoint& point = scan.points[k];
      const Eigen::Vector3f from_sensor = point.position + point.time_s * velocity;
      const Eigen::Vector3f position = (sensor + from_sensor) / kCellM;
      // What lies in a cell is not compared with what stands in it.
      const auto layer = static_cast<std::int16_t>(2 * floor_of(position.z()) + (point.stands ? 1 : 0));
      const auto x = static_cast<std::int16_t>(floor_of(position.x()));
      const auto y = static_cast<std::int16_t>(floor_of(position.y()));
      std::uint16_t& newest = newest_of_[column_of(x, y)];
      std::uint16_t number = find(newest, x, y, layer);
      if (number == kNone) {
        number = static_cast<std::uint16_t>(cells_.size());
        cells_.push_back({x, y, layer, newest, block_of(from_sensor, point.stands), 0, 0.0F});
        newest = number;
      }
      cells_[number].mean += point.detail;
      ++cells_[number].count;
    }
    for (CellMean& cell : cells_) cell.mean /= static_cast<float>(cell.count);
  }

  /// Adds the squared differences to those of `before`, by the blocks of `before`.
  void compare(const DetailCells& before, std::vector<float>* squares,
               std::vector<std::size_t>* counts) const {
    for (const CellMean& cell : cells_) {
      const std::uint16_t newest = before.newest_of_[column_of(cell.x, cell.y)];
      const std::uint16_t number = before.find(newest, cell.x, cell.y, cell.layer);
      if (number == kNone) continue;
      const CellMean& other = before.cells_[number];
      if (other.block >= kBlocks) continue;
      const float difference = cell.mean - other.mean;
      (*squares)[other.block] += difference * difference;
      ++(*counts)[other.block];
    }
  }

 private:
  static constexpr std::uint16_t kNone = 0xFFFFU;
  static_assert(kMostPoints < kNone, "each cell has a number");
  static constexpr std::uint32_t kTableBits = 8;  ///< 128 m: farther apart, columns share an entry

  struct CellMean {
    std::int16_t x;
    std::int16_t y;
    std::int16_t layer;
    std::uint16_t next;  ///< cell of the same column
    std::uint16_t block;
    std::uint16_t count;
    float mean;
  };

  static std::int32_t floor_of(float value) {
    const auto towards_zero = static_cast<std::int32_t>(value);
    return towards_zero - (static_cast<float>(towards_zero) > value ? 1 : 0);
  }

  static std::size_t column_of(std::int16_t x, std::int16_t y) {
    constexpr std::uint32_t kMask = (1U << kTableBits) - 1U;
    return ((static_cast<std::uint32_t>(y) & kMask) << kTableBits) | (static_cast<std::uint32_t>(x) & kMask);
  }

  /// The cell among those of its column, from `newest` on; kNone if it is empty.
  std::uint16_t find(std::uint16_t newest, std::int16_t x, std::int16_t y, std::int16_t layer) const {
    std::uint16_t number = newest;
    while (number != kNone) {
      const CellMean& cell = cells_[number];
      if (cell.layer == layer && cell.x == x && cell.y == y) break;
      number = cell.next;
    }
    return number;
  }

  static std::uint16_t block_of(const Eigen::Vector3f& from_sensor, bool stands) {
    const std::int32_t x = floor_of((from_sensor.x() + kReachM) / kBlockM);
    const std::int32_t y = floor_of((from_sensor.y() + kReachM) / kBlockM);
    if (x < 0 || y < 0 || x >= kBlocksAcross || y >= kBlocksAcross) return kBlocks;
    return static_cast<std::uint16_t>((stands ? kColumns : 0U) +
                                      static_cast<std::size_t>(y * kBlocksAcross + x));
  }

  std::vector<std::uint16_t> newest_of_ = std::vector<std::uint16_t>(1U << (2U * kTableBits), kNone);
  std::vector<CellMean> cells_;
};

BlockFits fits_of(const std::vector<BrightScan>& scans, const Eigen::Vector3d& velocity, const Depth& depth,
                  std::vector<DetailCells>* cells) {
  for (std::size_t k = 0; k < scans.size(); ++k) {
    const Eigen::Vector3d now = velocity + scans[k].gained_mps;
    const Eigen::Vector3d sensor =
        seconds_between(scans.front().stamp, scans[k].stamp) * velocity + scans[k].gained_m;
    (*cells)[k].fill(scans[k], now.cast<float>(), sensor.cast<float>(), depth.stride);
  }
  std::vector<float> squares(kBlocks, 0.0F);
  std::vector<std::size_t> counts(kBlocks, 0);
  for (std::size_t k = 0; k < scans.size(); ++k) {
    for (std::size_t apart = 1; apart <= std::min(k, depth.farthest); ++apart)
      (*cells)[k].compare((*cells)[k - apart], &squares, &counts);
  }
  BlockFits fits;
  fits.fill(kSilent);
  for (std::size_t b = 0; b < kBlocks; ++b) {
    if (counts[b] < kLeastCells) continue;
    const double mean = static_cast<double>(squares[b]) / static_cast<double>(counts[b]);
    fits[b] = static_cast<float>(-0.5 * std::log(mean + kNoise));
  }
  return fits;
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
  const std::vector<Eigen::Vector3d> velocities = level_velocities();
  std::vector<Hypothesis> result(velocities.size());
  constexpr std::size_t kChunk = 16;
  parallel_chunks(velocities.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
    std::vector<DetailCells> cells(scans.size());
    for (std::size_t k = begin; k < end; ++k) {
      result[k].velocity = velocities[k];
      result[k].fits = fits_of(scans, velocities[k], kCoarse, &cells);
    }
  });
  return result;
}

/// The best velocity near by, in smaller and smaller steps.
Hypothesis climbed(const std::vector<BrightScan>& scans, const Eigen::Vector3d& from,
                   const BlockFits& usual) {
  std::vector<DetailCells> cells(scans.size());
  const auto at = [&](const Eigen::Vector3d& velocity) {
    Hypothesis hypothesis;
    hypothesis.velocity = velocity;
    hypothesis.fits = fits_of(scans, velocity, kFine, &cells);
    hypothesis.score = votes(hypothesis.fits, usual);
    return hypothesis;
  };
  Hypothesis best = at(from);
  for (double step = kFirstStep; step >= kLastStep; step *= 0.5) {
    for (int move = 0; move < kMostMoves; ++move) {
      const Eigen::Vector3d middle = best.velocity;
      for (int axis = 0; axis < 2; ++axis) {
        for (const double sign : {-1.0, 1.0}) {
          Hypothesis next = at(middle + sign * step * Eigen::Vector3d::Unit(axis));
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
Eigen::Vector3d refined(const std::vector<BrightScan>& scans, const Eigen::Vector3d& top,
                        const BlockFits& usual) {
  Eigen::Vector3d velocity = top;
  std::array<double, 2 * kHillSteps + 1> heights{};
  for (int axis = 0; axis < 2; ++axis) {
    parallel_chunks(heights.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
      std::vector<DetailCells> cells(scans.size());
      const double offset = kHillStep * (static_cast<double>(k) - kHillSteps);
      const Eigen::Vector3d at = velocity + offset * Eigen::Vector3d::Unit(axis);
      heights[k] = votes(fits_of(scans, at, kFine, &cells), usual);
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
  std::vector<Hypothesis> best(chosen.size());
  parallel_chunks(chosen.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
    best[k] = climbed(scans, chosen[k], usual);
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
  motion.velocity = refined(scans, motion.velocity, usual);
  return motion;
}

}  // namespace fdi_lio::mapping
