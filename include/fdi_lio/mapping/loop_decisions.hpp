#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/mapping/loop_types.hpp"
#include "fdi_lio/mapping/odometry_frame.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// Which candidates become loops of the pose graph, and what the graph then makes of them. One that the
/// registration did not reject is taken at once while the odometry's prediction is good, else when a second
/// one agrees with it. What the graph does not follow in the end contradicts the others.
class LoopDecisions {
 public:
  enum class Outcome {
    kLeft,         ///< not, or not yet, in the graph
    kTaken,        ///< in the graph, which agreed with it already
    kContradicts,  ///< in the graph, whose next solution will tell
  };

  /// Standard deviation of a predicted pose about and along each axis.
  struct PredictionSigma {
    double rotation_rad = 0.0;
    double translation_m = 0.0;
  };

  explicit LoopDecisions(const LoopConfig& config) : config_(config) {}

  /// How far the odometry has drifted at way `path_m` since the last keyframe with an accepted loop.
  double drift_m(double path_m) const { return config_.drift_share * (path_m - loop_at_m_); }

  /// Of a pose there that the graph predicts.
  PredictionSigma prediction_sigma(double path_m) const;

  /// Sets the drift at `path_m`.
  void set_drift(double path_m, double drift_m) { loop_at_m_ = path_m - drift_m / config_.drift_share; }

  /// A candidate that leads to the newest of `frames`. `chain` are the poses of all of them as the steps of
  /// the odometry give them. Puts into `graph` what is taken: it, or it and the one that it agrees with.
  Outcome add(LoopCandidate candidate, const std::vector<OdometryFrame>& frames,
              const std::vector<Eigen::Isometry3d>& chain, PoseGraph* graph);

  /// Whether the candidate that came last is in the graph and not found to contradict the others.
  bool is_newest_taken() const;

  /// Gives up candidates to which no second one came.
  void expire(const std::vector<OdometryFrame>& frames);

  /// The graph was solved: gives the verdicts that waited for it.
  void solved(const std::vector<OdometryFrame>& frames, const PoseGraph& graph);

  /// Loops since then.
  int unsolved() const { return unsolved_; }

  /// Among them is one that the graph did not agree with.
  bool has_contradiction() const { return !unjudged_.empty(); }

  /// All candidates with what became of them.
  const std::vector<LoopCandidate>& loops() const { return loops_; }

 private:
  struct GraphLoop {
    std::size_t candidate;  ///< index in `loops_`
    std::size_t in_graph;
  };

  bool agree(const LoopCandidate& a, const LoopCandidate& b, const std::vector<OdometryFrame>& frames,
             const std::vector<Eigen::Isometry3d>& chain) const;
  Outcome take(const std::vector<std::size_t>& indices, const std::vector<OdometryFrame>& frames,
               PoseGraph* graph);
  void judge(const std::vector<GraphLoop>& loops, const std::vector<OdometryFrame>& frames,
             const PoseGraph& graph);

  LoopConfig config_;
  std::vector<LoopCandidate> loops_;
  std::vector<std::size_t> pending_;  ///< indices in `loops_`
  std::vector<GraphLoop> unjudged_;   ///< those whose verdict the next solution will give
  int unsolved_ = 0;
  double loop_at_m_ = 0.0;  ///< way at the last keyframe with an accepted loop
};

}  // namespace fdi_lio::mapping
