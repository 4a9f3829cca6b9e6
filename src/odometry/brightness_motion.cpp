#include "fdi_lio/odometry/brightness_motion.hpp"

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
#include "fdi_lio/odometry/detail_cells.hpp"

namespace fdi_lio::odometry {

namespace {

/// Of a vote: what stands may drive.
constexpr double kStandingWeight = 0.4;
constexpr double kMaxSpeed = 45.0;
constexpr double kCoarseStep = 3.0;  ///< [m/s]
constexpr double kOpenStep = 1.0;    ///< the same along the direction that surfaces leave open
constexpr double kFirstStep = 2.0;   ///< of the search about a candidate [m/s]
constexpr double kLastStep = 0.5;
constexpr int kHillSteps = 15;     ///< to each side of the velocity found
constexpr double kHillStep = 0.2;  ///< [m/s]
constexpr int kHillSize = 2 * kHillSteps + 1;
constexpr double kWindowSteps = 4.0;  ///< standard deviation of what the hill is smoothed with
constexpr int kWindowReach = 6;
constexpr int kMostMoves = 4;          ///< of each size
constexpr double kSameVelocity = 3.0;  ///< below, two velocities are one
constexpr std::size_t kFinalists = 6;
/// Logarithm of the likelihood of a velocity for each vote.
constexpr double kLikelihoodOfVote = 2.0;

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

/// The median, which the values are sorted about; 0 of none.
float median(std::vector<float>* values) {
  if (values->empty()) return 0.0F;
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

/// How the blocks vote between velocities. A vehicle beside the sensor is a few blocks, and has as many
/// votes, however well it is seen; blocks that compared fewer pairs of means than the median one of the
/// coarse search have a part of a vote.
class Ballot {
 public:
  explicit Ballot(const std::vector<Hypothesis>& all) {
    std::vector<float> pairs;
    std::vector<float> fits;
    for (std::size_t b = 0; b < DetailCells::kBlocks; ++b) {
      fits.clear();
      for (const Hypothesis& hypothesis : all) {
        if (hypothesis.fits[b].pairs <= 0.0F) continue;
        fits.push_back(hypothesis.fits[b].fit);
        pairs.push_back(hypothesis.fits[b].pairs);
      }
      if (!fits.empty()) usual_[b] = {median(&fits), std::numeric_limits<float>::infinity()};
    }
    whole_vote_pairs_ = median(&pairs);
  }

  double votes(const DetailCells::Fits& one, const DetailCells::Fits& other) const {
    double sum = 0.0;
    for (std::size_t b = 0; b < DetailCells::kBlocks; ++b) {
      const float pairs = std::min({one[b].pairs, other[b].pairs, whole_vote_pairs_});
      if (pairs <= 0.0F) continue;
      const double share = static_cast<double>(pairs / whole_vote_pairs_);
      const double weight = b < DetailCells::kLying ? 1.0 : kStandingWeight;
      sum += share * weight * std::clamp(static_cast<double>(one[b].fit - other[b].fit), -1.0, 1.0);
    }
    return sum;
  }

  /// For a velocity over the usual one.
  double votes(const DetailCells::Fits& one) const { return votes(one, usual_); }

 private:
  DetailCells::Fits usual_;
  float whole_vote_pairs_ = 0.0F;
};

/// Mean of the fits of all pairs: what they are worth if their differences are independent. Sharper near the
/// truth than one vote a block, but what drives counts by its size.
double agreement(const DetailCells::Fits& fits) {
  double sum = 0.0;
  double pairs = 0.0;
  for (const DetailCells::Fit& one : fits) {
    if (one.pairs <= 0.0F) continue;
    sum += static_cast<double>(one.pairs) * static_cast<double>(one.fit);
    pairs += static_cast<double>(one.pairs);
  }
  return pairs > 0.0 ? sum / pairs : 0.0;
}

bool is_same(const Eigen::Vector3d& one, const Eigen::Vector3d& other) {
  return (one - other).norm() <= kSameVelocity;
}

/// Level velocities that compete: all, or those alone that are known across the open direction.
class Competition {
 public:
  Competition(const Eigen::Vector3d& known, const std::optional<Eigen::Vector3d>& open_direction) {
    if (open_direction) {
      axes_ = {*open_direction};
      const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross(*open_direction);
      known_across_ = known.dot(across) * across;
    } else {
      axes_ = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY()};
    }
  }

  /// Along which velocities are varied: two, or the open direction.
  const std::vector<Eigen::Vector3d>& axes() const { return axes_; }

  std::vector<Eigen::Vector3d> coarse_velocities() const {
    std::vector<Eigen::Vector3d> result = {known_across_};
    for (const Eigen::Vector3d& axis : axes_) {
      const double step = is_open() ? kOpenStep : kCoarseStep;
      const int steps = static_cast<int>(kMaxSpeed / step);
      const std::vector<Eigen::Vector3d> before = std::move(result);
      result.clear();
      for (const Eigen::Vector3d& velocity : before) {
        for (int k = -steps; k <= steps; ++k) {
          const Eigen::Vector3d next = velocity + step * k * axis;
          if (next.norm() <= kMaxSpeed) result.push_back(next);
        }
      }
    }
    return result;
  }

  /// Fewer competitors can be looked at more closely.
  const Depth& coarse_depth() const { return is_open() ? kFine : kCoarse; }

 private:
  bool is_open() const { return axes_.size() == 1; }

  std::vector<Eigen::Vector3d> axes_;
  Eigen::Vector3d known_across_ = Eigen::Vector3d::Zero();  ///< zero where nothing is known
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
Hypothesis climbed(const std::vector<LaneScan>& scans, const Eigen::Vector3d& from, const Ballot& ballot,
                   const Competition& competition) {
  DetailCells cells;
  const auto at = [&](const Eigen::Vector3d& velocity) {
    Hypothesis hypothesis;
    hypothesis.velocity = velocity;
    hypothesis.fits = cells.fits(scans, velocity, kFine.farthest);
    hypothesis.score = ballot.votes(hypothesis.fits);
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
          Hypothesis next = at(velocity);
          if (next.score > best.score) best = next;
        }
      }
      if (best.velocity == middle) break;
    }
  }
  return best;
}

/// Agreement at equal steps of the velocity.
using Heights = std::array<double, kHillSize>;

/// The place of the hill's top, in steps from its middle: single steps scatter, their mean with a Gaussian
/// window less.
double top_of(const Heights& heights) {
  Heights smooth{};
  for (int k = 0; k < kHillSize; ++k) {
    for (int other = -kWindowReach; other <= kWindowReach; ++other) {
      const double weight = std::exp(-0.5 * std::pow(other / kWindowSteps, 2.0));
      smooth[static_cast<std::size_t>(k)] +=
          weight * heights[static_cast<std::size_t>(std::clamp(k + other, 0, kHillSize - 1))];
    }
  }
  const auto highest = std::max_element(smooth.begin() + 1, smooth.end() - 1);
  const double left = *(highest - 1) - *highest;
  const double right = *(highest + 1) - *highest;
  const double bend = left + right;
  const double beside = bend < 0.0 ? std::clamp(0.5 * (left - right) / bend, -1.0, 1.0) : 0.0;
  return static_cast<double>(highest - smooth.begin()) - kHillSteps + beside;
}

/// The top of the hill of agreement about a velocity, along each axis: the other one moved it, so twice.
Eigen::Vector3d refined(const std::vector<LaneScan>& scans, const Eigen::Vector3d& from,
                        const Competition& competition) {
  Eigen::Vector3d velocity = from;
  std::vector<Eigen::Vector3d> axes = competition.axes();
  if (axes.size() > 1) axes.insert(axes.end(), competition.axes().begin(), competition.axes().end());
  Heights heights{};
  for (const Eigen::Vector3d& axis : axes) {
    parallel_chunks(heights.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
      DetailCells cells;
      const Eigen::Vector3d at = velocity + kHillStep * (static_cast<double>(k) - kHillSteps) * axis;
      heights[k] = agreement(cells.fits(scans, at, kFine.farthest));
    });
    velocity += kHillStep * top_of(heights) * axis;
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
  const Ballot ballot(coarse);
  for (Hypothesis& hypothesis : coarse) hypothesis.score = ballot.votes(hypothesis.fits);

  const std::vector<Eigen::Vector3d> chosen = finalists(std::move(coarse), known_velocity);
  const std::vector<LaneScan> lanes = lanes_of(scans, kFine.stride);
  std::vector<Hypothesis> best(chosen.size());
  parallel_chunks(chosen.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
    best[k] = climbed(lanes, chosen[k], ballot, competition);
  });
  BrightnessMotion motion;
  motion.lead = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& one : best) {
    double lead = std::numeric_limits<double>::infinity();
    for (const Hypothesis& other : best) {
      if (!is_same(one.velocity, other.velocity)) lead = std::min(lead, ballot.votes(one.fits, other.fits));
    }
    if (lead <= motion.lead) continue;
    motion.velocity = one.velocity;
    motion.lead = lead;
    motion.is_known = is_same(one.velocity, known_velocity);
  }
  motion.velocity = refined(lanes, motion.velocity, competition);
  DetailCells cells;
  motion.lead_over_known = ballot.votes(cells.fits(lanes, motion.velocity, kFine.farthest),
                                        cells.fits(lanes, known_velocity, kFine.farthest));
  return motion;
}

BrightnessOffset find_brightness_offset(std::vector<BrightScan> scans, const Eigen::Vector3d& velocity,
                                        const Eigen::Vector3d& axis) {
  subtract_fixed(&scans);
  const std::vector<LaneScan> lanes = lanes_of(scans, kFine.stride);
  std::vector<Hypothesis> hypotheses(kHillSize);
  const auto offset = [](std::size_t k) { return kHillStep * (static_cast<double>(k) - kHillSteps); };
  parallel_chunks(hypotheses.size(), 1, [&](std::size_t, std::size_t, std::size_t k) {
    DetailCells cells;
    hypotheses[k].velocity = velocity + offset(k) * axis;
    hypotheses[k].fits = cells.fits(lanes, hypotheses[k].velocity, kFine.farthest);
  });
  const Ballot ballot(hypotheses);
  double most_votes = -std::numeric_limits<double>::infinity();
  for (Hypothesis& hypothesis : hypotheses) {
    hypothesis.score = ballot.votes(hypothesis.fits);
    most_votes = std::max(most_votes, hypothesis.score);
  }
  double sum = 0.0;
  double first_moment = 0.0;
  double second_moment = 0.0;
  for (std::size_t k = 0; k < hypotheses.size(); ++k) {
    const double likelihood = std::exp(kLikelihoodOfVote * (hypotheses[k].score - most_votes));
    sum += likelihood;
    first_moment += likelihood * offset(k);
    second_moment += likelihood * offset(k) * offset(k);
  }
  BrightnessOffset result;
  result.mean_mps = first_moment / sum;
  result.variance = second_moment / sum - result.mean_mps * result.mean_mps + kHillStep * kHillStep / 12.0;
  return result;
}

}  // namespace fdi_lio::odometry
