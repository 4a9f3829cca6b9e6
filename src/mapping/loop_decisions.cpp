#include "fdi_lio/mapping/loop_decisions.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kDegree = M_PI / 180.0;
/// Uncertainty of a relative pose that no drift has widened.
constexpr double kBaseSigmaM = 0.1;
constexpr double kBaseSigmaRad = 0.5 * kDegree;
/// A loop that the graph takes with less weight contradicts the others.
constexpr double kMinLoopWeight = 0.25;
/// A loop deviates from a graph that agrees with it by this at most, squared and in standard deviations: the
/// next loop is searched for from poses that were not corrected by this one.
constexpr double kAgreeingSq = 0.5;
/// How long a loop waits for a second one that agrees.
constexpr double kConfirmationPathM = 60.0;

}  // namespace

LoopDecisions::PredictionSigma LoopDecisions::prediction_sigma(double path_m) const {
  return {kBaseSigmaRad + config_.drift_rotation_deg_per_m * kDegree * (path_m - loop_at_m_),
          kBaseSigmaM + drift_m(path_m)};
}

LoopDecisions::Outcome LoopDecisions::add(LoopCandidate added, const std::vector<OdometryFrame>& frames,
                                          const std::vector<Eigen::Isometry3d>& chain, PoseGraph* graph) {
  loops_.push_back(std::move(added));
  LoopCandidate& candidate = loops_.back();
  const std::size_t index = loops_.size() - 1;
  if (candidate.verdict != LoopVerdict::kPending) return Outcome::kLeft;
  if (candidate.chi_square > config_.max_chi_square) {
    candidate.verdict = LoopVerdict::kFarFromPrediction;
    return Outcome::kLeft;
  }
  std::vector<std::size_t> taken = {index};
  if (drift_m(frames.back().path_m) > config_.confirm_above_m) {
    const auto agreeing = std::find_if(pending_.begin(), pending_.end(), [&](std::size_t other) {
      return agree(loops_[other], candidate, frames, chain);
    });
    if (agreeing == pending_.end()) {
      pending_.push_back(index);
      return Outcome::kLeft;
    }
    taken.push_back(*agreeing);
    pending_.erase(agreeing);
  }
  return take(taken, frames, graph);
}

/// A graph that agrees with them already waits for more: on a way that is driven again and again nearly every
/// loop says what is known.
LoopDecisions::Outcome LoopDecisions::take(const std::vector<std::size_t>& indices,
                                           const std::vector<OdometryFrame>& frames, PoseGraph* graph) {
  bool agrees = true;
  std::vector<GraphLoop> taken;
  for (const std::size_t index : indices) {
    const RelativePose& measured = loops_[index].measured;
    agrees = agrees && graph->squared_error(measured) <= kAgreeingSq;
    taken.push_back({index, graph->add_loop(measured)});
  }
  unsolved_ += static_cast<int>(indices.size());
  if (agrees) {
    judge(taken, frames, *graph);
    return Outcome::kTaken;
  }
  unjudged_.insert(unjudged_.end(), taken.begin(), taken.end());
  return Outcome::kContradicts;
}

/// Whether going round a_from -> a_to -> b_to -> b_from -> a_from leads back, given the odometry's drift
/// between the two.
bool LoopDecisions::agree(const LoopCandidate& a, const LoopCandidate& b,
                          const std::vector<OdometryFrame>& frames,
                          const std::vector<Eigen::Isometry3d>& chain) const {
  const auto odometry = [&chain](std::size_t from, std::size_t to) {
    return chain[from].inverse() * chain[to];
  };
  const Eigen::Isometry3d T_expected = odometry(a.measured.from, b.measured.from).inverse() *
                                       a.measured.T_from_to * odometry(a.measured.to, b.measured.to);
  const double way_m = std::abs(frames[a.measured.from].path_m - frames[b.measured.from].path_m) +
                       std::abs(frames[a.measured.to].path_m - frames[b.measured.to].path_m);
  if (way_m > 2.0 * kConfirmationPathM) return false;
  const Matrix6d covariance = a.covariance + b.covariance +
                              isotropic(kBaseSigmaRad + config_.drift_rotation_deg_per_m * kDegree * way_m,
                                        kBaseSigmaM + config_.drift_share * way_m);
  const Vector6d error = difference(T_expected, b.measured.T_from_to);
  return error.dot(covariance.ldlt().solve(error)) <= config_.max_chi_square;
}

/// What the graph makes of loops that it has.
void LoopDecisions::judge(const std::vector<GraphLoop>& loops, const std::vector<OdometryFrame>& frames,
                          const PoseGraph& graph) {
  for (const GraphLoop& loop : loops) {
    LoopCandidate& candidate = loops_[loop.candidate];
    const bool is_followed = graph.loop_weight(loop.in_graph) >= kMinLoopWeight;
    candidate.verdict = is_followed ? LoopVerdict::kAccepted : LoopVerdict::kInconsistent;
    if (is_followed) loop_at_m_ = std::max(loop_at_m_, frames[candidate.measured.to].path_m);
  }
}

bool LoopDecisions::is_newest_taken() const {
  if (loops_.empty()) return false;
  const bool is_unjudged = std::any_of(unjudged_.begin(), unjudged_.end(), [this](const GraphLoop& loop) {
    return loop.candidate + 1 == loops_.size();
  });
  return is_unjudged || loops_.back().verdict == LoopVerdict::kAccepted;
}

void LoopDecisions::expire(const std::vector<OdometryFrame>& frames) {
  const auto is_late = [&](std::size_t index) {
    return frames.back().path_m - frames[loops_[index].measured.to].path_m > kConfirmationPathM;
  };
  for (const std::size_t index : pending_) {
    if (is_late(index)) loops_[index].verdict = LoopVerdict::kUnconfirmed;
  }
  pending_.erase(std::remove_if(pending_.begin(), pending_.end(), is_late), pending_.end());
}

void LoopDecisions::solved(const std::vector<OdometryFrame>& frames, const PoseGraph& graph) {
  unsolved_ = 0;
  judge(unjudged_, frames, graph);
  unjudged_.clear();
}

}  // namespace fdi_lio::mapping
