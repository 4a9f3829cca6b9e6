#include "fdi_lio/mapping/brightness_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/detail_cells.hpp"

namespace fdi_lio::mapping {

namespace {

/// Of a vote: what stands may drive.
constexpr double kStandingWeight = 0.4;
constexpr double kMaxSpeed = 45.0;
constexpr double kCoarseStep = 3.0;   ///< [m/s]
constexpr double kOpenStep = 1.0;     ///< the same along the direction that surfaces leave open
constexpr double kAcrossReach = 0.5;  ///< to both sides of what surfaces say across it
constexpr double kFirstStep = 2.0;    ///< of the search about a candidate [m/s]
constexpr double kLastStep = 0.5;
constexpr int kHillSteps = 5;  ///< to each side of the velocity found
constexpr double kHillStep = 0.4;
constexpr int kMostMoves = 4;          ///< of each size
constexpr double kSameVelocity = 3.0;  ///< below, two velocities are one
constexpr std::size_t kFinalists = 6;

struct Depth {
  std::size_t stride;    ///< of the points
  std::size_t farthest;  ///< scans apart that are compared
};
constexpr Depth kCoarse = {4, 4};
constexpr Depth kFine = {1, 6};

struct Hypothesis {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
  DetailCells::Fits fits{};
  double score = 0.0;
};

/// What a block says of the usual velocity.
DetailCells::Fits medians(const std::vector<Hypothesis>& all) {
  DetailCells::Fits result;
  std::vector<float> values;
  for (std::size_t b = 0; b < DetailCells::kBlocks; ++b) {
    values.clear();
    for (const Hypothesis& hypothesis : all) {
      if (!std::isnan(hypothesis.fits[b])) values.push_back(hypothesis.fits[b]);
    }
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    result[b] = values.empty() ? DetailCells::kSilent : *middle;
  }
  return result;
}

double votes(const DetailCells::Fits& one, const DetailCells::Fits& other) {
  double sum = 0.0;
  for (std::size_t b = 0; b < DetailCells::kBlocks; ++b) {
    if (std::isnan(one[b]) || std::isnan(other[b])) continue;
    const double weight = b < DetailCells::kLying ? 1.0 : kStandingWeight;
    sum += weight * std::clamp(static_cast<double>(one[b]) - static_cast<double>(other[b]), -1.0, 1.0);
  }
  return sum;
}

bool is_same(const Eigen::Vector3d& one, const Eigen::Vector3d& other) {
  return (one - other).norm() <= kSameVelocity;
}

/// Level velocities that compete.
class Competition {
 public:
  Competition(const Eigen::Vector3d& known, const std::optional<Eigen::Vector3d>& open_direction)
      : known_(known), is_open_along_(open_direction) {
    if (open_direction) axes_ = {*open_direction, Eigen::Vector3d::UnitZ().cross(*open_direction)};
  }

  /// Along which velocities are varied; the first is the open direction, if there is one.
  const std::array<Eigen::Vector3d, 2>& axes() const { return axes_; }

  bool contains(const Eigen::Vector3d& velocity) const {
    return !is_open_along_ || std::abs((velocity - known_).dot(axes_[1])) <= kAcrossReach;
  }

  std::vector<Eigen::Vector3d> coarse_velocities() const {
    const double step = is_open_along_ ? kOpenStep : kCoarseStep;
    const int steps = static_cast<int>(kMaxSpeed / step);
    const int steps_across = is_open_along_ ? 0 : steps;
    const Eigen::Vector3d middle =
        is_open_along_ ? Eigen::Vector3d(known_.dot(axes_[1]) * axes_[1]) : Eigen::Vector3d::Zero();
    std::vector<Eigen::Vector3d> result;
    for (int a = -steps; a <= steps; ++a) {
      for (int b = -steps_across; b <= steps_across; ++b) {
        const Eigen::Vector3d velocity = middle + step * (a * axes_[0] + b * axes_[1]);
        if (velocity.norm() <= kMaxSpeed) result.push_back(velocity);
      }
    }
    return result;
  }

  /// Fewer competitors can be looked at more closely.
  const Depth& coarse_depth() const { return is_open_along_ ? kFine : kCoarse; }

 private:
  Eigen::Vector3d known_;
  bool is_open_along_;
  std::array<Eigen::Vector3d, 2> axes_ = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()};
};

std::vector<Hypothesis> coarse_hypotheses(const std::vector<BrightScan>& scans,
                                          const Competition& competition) {
  const Depth& depth = competition.coarse_depth();
  const std::vector<LaneScan> lanes = lanes_of(scans, depth.stride);
  const std::vector<Eigen::Vector3d> velocities = competition.coarse_velocities();
  std::vector<Hypothesis> result(velocities.size());
  constexpr std::size_t kChunk = 16;
  parallel_chunks(velocities.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
    DetailCells cells;
    for (std::size_t k = begin; k < end; ++k) {
      result[k].velocity = velocities[k];
      result[k].fits = cells.fits(lanes, velocities[k], depth.farthest);
    }
  });
  return result;
}

/// The best velocity near by, in smaller and smaller steps.
Hypothesis climbed(const std::vector<LaneScan>& scans, const Eigen::Vector3d& from,
                   const DetailCells::Fits& usual, const Competition& competition) {
  DetailCells cells;
  const auto at = [&](const Eigen::Vector3d& velocity) {
    Hypothesis hypothesis;
    hypothesis.velocity = velocity;
    hypothesis.fits = cells.fits(scans, velocity, kFine.farthest);
    hypothesis.score = votes(hypothesis.fits, usual);
    return hypothesis;
  };
  Hypothesis best = at(from);
  Eigen::Vector3d middle = from;
  for (double step = kFirstStep; step >= kLastStep; step *= 0.5) {
    for (int move = 0; move < kMostMoves; ++move) {
      const Eigen::Vector3d before = middle;
      middle = best.velocity;
      for (const Eigen::Vector3d& axis : competition.axes()) {
        for (const double sign : {-1.0, 1.0}) {
          const Eigen::Vector3d velocity = middle + sign * step * axis;
          if (velocity.isApprox(before)) continue;  // where the last move came from
          if (!competition.contains(velocity)) continue;
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
                        const DetailCells::Fits& usual, const Competition& competition) {
  Eigen::Vector3d velocity = top;
  std::array<double, 2 * kHillSteps + 1> heights{};
  for (const Eigen::Vector3d& axis : competition.axes()) {
    parallel_chunks(heights.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
      DetailCells cells;
      const double offset = kHillStep * (static_cast<double>(k) - kHillSteps);
      const Eigen::Vector3d at = velocity + offset * axis;
      heights[k] = votes(cells.fits(scans, at, kFine.farthest), usual);
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
    if (std::abs(middle) <= kHillSteps * kHillStep) velocity += middle * axis;
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

}  // namespace

BrightnessMotion find_brightness_motion(std::vector<BrightScan> scans, const KnownMotion& known) {
  subtract_fixed(&scans);
  const double time_s = std::max(1e-3, seconds_between(scans.front().stamp, scans.back().stamp));
  const Eigen::Vector3d known_velocity = (known.way - scans.back().gained_m) / time_s;
  const Competition competition(known_velocity, known.open_direction);
  std::vector<Hypothesis> coarse = coarse_hypotheses(scans, competition);
  const DetailCells::Fits usual = medians(coarse);
  for (Hypothesis& hypothesis : coarse) hypothesis.score = votes(hypothesis.fits, usual);

  const std::vector<Eigen::Vector3d> chosen = finalists(std::move(coarse), known_velocity);
  const std::vector<LaneScan> lanes = lanes_of(scans, kFine.stride);
  std::vector<Hypothesis> best(chosen.size());
  parallel_chunks(chosen.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
    best[k] = climbed(lanes, chosen[k], usual, competition);
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
  motion.velocity = refined(lanes, motion.velocity, usual, competition);
  return motion;
}

}  // namespace fdi_lio::mapping
