#include "fdi_lio/mapping/global_optimizer.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <malloc.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/ghost_remover.hpp"
#include "fdi_lio/mapping/graph_measurements.hpp"
#include "fdi_lio/mapping/loop_decisions.hpp"
#include "fdi_lio/mapping/loop_detector.hpp"
#include "fdi_lio/mapping/loop_verifier.hpp"
#include "fdi_lio/mapping/map_level.hpp"
#include "fdi_lio/mapping/odometry_check.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kDegree = M_PI / 180.0;
/// The more keyframes there are, the longer an optimisation takes and the less a single loop changes: one
/// keyframe comes between two optimisations for each so many. So the mean cost of a keyframe stays the same.
constexpr std::size_t kKeyframesOfWait = 200;
/// Way before the later keyframe whose scans are registered together with it.
constexpr double kSourceLengthM = 5.0;
constexpr std::size_t kSourceKeyframes = 4;
/// Keyframes before the newest one that it is registered with, when its step is checked.
constexpr std::size_t kStepKeyframes = 10;
/// How far off a session may be that was placed in another.
constexpr double kSessionSigmaM = 5.0;
constexpr double kSessionSigmaRad = 10.0 * kDegree;
/// The search for its loops is that of an odometry that is off by so much.
constexpr double kSessionDriftM = 1.0;
/// The descriptor's place may be so far from the keyframe's.
constexpr double kDescriptorSigmaM = 3.0;
constexpr double kDescriptorSigmaRad = 4.0 * kDegree;
/// What a keyframe takes besides its cloud: 5 KB of descriptor, and the graph with what its solver needs,
/// which is 9 KB with few loops (`benchmark_pose_graph`) and up to 35 KB on streets that are driven again and
/// again.
constexpr std::size_t kBytesOfKeyframe = 40 << 10;
/// The least share of the memory that is left to the clouds.
constexpr std::size_t kLeastShare = 10;

PoseGraphSettings graph_settings(const ExternalOdometryConfig& external) {
  PoseGraphSettings settings;
  settings.external_scale_sigma = external.sigma_scale;
  return settings;
}

/// The longer the way, the fewer clouds have room beside what all keyframes need.
std::size_t memory_of_clouds(const LoopConfig& config, std::size_t keyframes) {
  const std::size_t memory = static_cast<std::size_t>(config.cloud_memory_mb) << 20U;
  return std::max(memory / kLeastShare, memory - std::min(memory, keyframes * kBytesOfKeyframe));
}

}  // namespace

class GlobalOptimizer::Implementation {
 public:
  Implementation(const Config& config, Reporter* reporter)
      : config_(config.loop),
        reporter_(reporter),
        graph_(graph_settings(config.external_odometry)),
        ghosts_(config.dynamic, config.sensor.T_imu_lidar()),
        store_(memory_of_clouds(config.loop, 0)),
        detector_(config.loop),
        verifier_(config),
        decisions_(config.loop),
        measurements_(config, reporter),
        level_(config) {}

  void add(Keyframe keyframe);
  void add_external(const ExternalPose& pose);
  void solve();
  void optimise();
  void clean_clouds(bool is_last);

  Eigen::Isometry3d correction(std::size_t k) const { return poses_[k] * frames_[k].T_odom_imu.inverse(); }
  Eigen::Isometry3d correct(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const;

  LoopConfig config_;
  Reporter* reporter_;
  PoseGraph graph_;
  GhostRemover ghosts_;
  KeyframeStore store_;
  LoopDetector detector_;
  LoopVerifier verifier_;
  std::vector<OdometryFrame> frames_;
  std::vector<Eigen::Isometry3d> poses_;  ///< of the graph, as last solved
  /// The steps of the graph one after the other, which no loop has bent: the odometry, where nothing
  /// contradicts it.
  std::vector<Eigen::Isometry3d> chain_;
  OdometryCheck check_;
  LoopDecisions decisions_;
  double searched_at_m_ = 0.0;
  GraphMeasurements measurements_;
  std::size_t solved_at_ = 0;  ///< keyframes at the last optimisation
  MapLevel level_;
  bool is_levelled_ = false;  ///< `poses_` are the chain without its tilt, and not the graph's

 private:
  RelativePose odometry_step(const Keyframe& keyframe, double step_m) const;
  RelativePose checked_step(const RelativePose& odometry);
  void search();
  LoopCandidate examine(const LoopProposal& proposal);
  std::vector<PlacedCloud> submap(std::size_t center, double before_m, double after_m, std::size_t limit);
  void level();
  void use_smoothed_gravity();
  bool has_sessions() const;
  bool may_solve() const { return frames_.size() - solved_at_ >= frames_.size() / kKeyframesOfWait; }
  void use_measurements();
};

RelativePose GlobalOptimizer::Implementation::odometry_step(const Keyframe& keyframe, double step_m) const {
  const Eigen::Isometry3d& T_odom_before = frames_.back().T_odom_imu;
  RelativePose edge;
  edge.from = frames_.size() - 1;
  edge.to = frames_.size();
  edge.T_from_to = T_odom_before.inverse() * keyframe.T_odom_imu;
  if (keyframe.begins_session) {
    edge.information = isotropic(kSessionSigmaRad, kSessionSigmaM).inverse();
    return edge;
  }
  const double way_m = std::max(step_m, 0.1);
  Matrix6d covariance = isotropic(config_.odometry_sigma_rotation_deg * kDegree * std::sqrt(way_m),
                                  config_.odometry_sigma_translation * std::sqrt(way_m));
  // What the scan does not determine (the axis of a tunnel) shows in the estimator's covariance.
  Matrix6d to_step = Matrix6d::Identity();
  to_step.bottomRightCorner<3, 3>() = T_odom_before.linear().transpose();
  covariance += to_step * keyframe.covariance * to_step.transpose();
  edge.information = covariance.inverse();
  return edge;
}

/// A step of the odometry, compared with what the clouds say. The newest one is in the store already.
RelativePose GlobalOptimizer::Implementation::checked_step(const RelativePose& odometry) {
  std::vector<PlacedCloud> target;
  std::size_t k = frames_.size();
  do {
    --k;
    target.push_back({store_.get(k), chain_[odometry.from].inverse() * chain_[k]});
  } while (k > 0 && target.size() < kStepKeyframes && !frames_[k].begins_session);
  const PlacedCloud source = {store_.get(odometry.to), Eigen::Isometry3d::Identity()};
  const auto registered = verifier_.register_step(target, {source}, odometry.T_from_to);
  if (!registered) {
    check_.unregistered();
    return odometry;
  }
  const RelativePose step = check_.checked(odometry, *registered);
  if (check_.contradicts())
    reporter_->report(Severity::kWarning, "odometry_contradicted",
                      "the clouds of the keyframes fit together otherwise than the odometry says: the map "
                      "takes the steps that the clouds show");
  return step;
}

void GlobalOptimizer::Implementation::add(Keyframe keyframe) {
  const PlaceDescriptor place = describe_place(keyframe.cloud.surface, levelled(keyframe.T_odom_imu.linear()),
                                               config_.descriptor_range_m);
  // First what a full disk may stop: then nothing has changed, and what came before can still be saved.
  store_.set_memory_limit(memory_of_clouds(config_, frames_.size()));
  store_.add(std::move(keyframe.cloud));
  ghosts_.add(keyframe.T_odom_imu, std::move(keyframe.image), keyframe.begins_session);
  clean_clouds(false);
  if (frames_.empty()) {
    graph_.add_node(keyframe.T_odom_imu);
    poses_.push_back(keyframe.T_odom_imu);
    chain_.push_back(keyframe.T_odom_imu);
    frames_.push_back({keyframe.stamp, keyframe.T_odom_imu, 0.0, true});
  } else {
    double step_m = (frames_.back().T_odom_imu.inverse() * keyframe.T_odom_imu).translation().norm();
    if (keyframe.begins_session) {
      // All keyframes of before are old enough for loops.
      step_m = config_.min_path_m;
      decisions_.set_drift(frames_.back().path_m + step_m, kSessionDriftM);
    }
    RelativePose edge = odometry_step(keyframe, step_m);
    if (config_.enabled && !keyframe.begins_session && check_.is_due()) edge = checked_step(edge);
    chain_.push_back(chain_.back() * edge.T_from_to);
    poses_.push_back(poses_.back() * edge.T_from_to);
    graph_.add_node(poses_.back());
    graph_.add_odometry(edge);
    frames_.push_back(
        {keyframe.stamp, keyframe.T_odom_imu, frames_.back().path_m + step_m, keyframe.begins_session});
  }
  level_.add(keyframe.stamp, keyframe.T_odom_imu.translation(), keyframe.gravity);
  measurements_.add_gravity(frames_, poses_.back(), keyframe.down_imu, &graph_);
  detector_.add(place, frames_.back().path_m);
  if (config_.enabled && frames_.back().path_m - searched_at_m_ >= config_.spacing_m) search();
  const bool is_due = decisions_.has_contradiction() || decisions_.unsolved() >= config_.solve_every;
  if (is_due && may_solve()) solve();
  use_measurements();
}

void GlobalOptimizer::Implementation::use_measurements() {
  while (measurements_.use(frames_, poses_, &graph_)) solve();
}

void GlobalOptimizer::Implementation::add_external(const ExternalPose& pose) {
  measurements_.add_external(pose);
  if (!frames_.empty()) use_measurements();
}

void GlobalOptimizer::Implementation::clean_clouds(bool is_last) {
  while (const auto k = ghosts_.next(is_last)) {
    if (auto cleaned = ghosts_.clean(*k, *store_.get(*k))) store_.replace(*k, std::move(*cleaned));
  }
}

/// Gravity of each keyframe by what came after it, too. A session keeps no more than its keyframes knew.
void GlobalOptimizer::Implementation::use_smoothed_gravity() {
  if (has_sessions()) return;
  const std::vector<Eigen::Vector3d> down_odom = level_.down_odom();
  for (std::size_t k = 0; k < down_odom.size(); ++k) {
    measurements_.set_gravity(k, frames_[k].T_odom_imu.linear().transpose() * down_odom[k], down_odom.front(),
                              &graph_);
  }
}

void GlobalOptimizer::Implementation::solve() {
  use_smoothed_gravity();
  if (!graph_.solve())
    reporter_->report(Severity::kError, "pose_graph", "the pose graph could not be optimised");
  for (std::size_t k = 0; k < poses_.size(); ++k) poses_[k] = graph_.pose(k);
  is_levelled_ = false;
  measurements_.solved();
  // What the solver needed lies scattered between what stays.
  malloc_trim(0);
  solved_at_ = frames_.size();
  decisions_.solved(frames_, graph_);
}

void GlobalOptimizer::Implementation::optimise() {
  if (measurements_.unsolved() + decisions_.unsolved() > 0) {
    solve();
  } else if (config_.enabled && config_.level_map && solved_at_ == 0) {
    level();
  }
}

bool GlobalOptimizer::Implementation::has_sessions() const {
  return std::count_if(frames_.begin(), frames_.end(),
                       [](const OdometryFrame& frame) { return frame.begins_session; }) > 1;
}

/// Sessions that nothing ties together have no common level.
void GlobalOptimizer::Implementation::level() {
  if (has_sessions()) return;
  poses_ = levelled_poses(chain_, level_.tilts());
  is_levelled_ = true;
}

void GlobalOptimizer::Implementation::search() {
  searched_at_m_ = frames_.back().path_m;
  decisions_.expire(frames_);
  for (const LoopProposal& proposal : detector_.propose(poses_, decisions_.drift_m(searched_at_m_))) {
    const LoopDecisions::Outcome outcome = decisions_.add(examine(proposal), frames_, chain_, &graph_);
    if (outcome == LoopDecisions::Outcome::kContradicts && may_solve()) solve();
    if (decisions_.is_newest_taken()) break;
  }
}

/// Keyframes about `center`, in its frame; at most `limit`, evenly spread.
std::vector<PlacedCloud> GlobalOptimizer::Implementation::submap(std::size_t center, double before_m,
                                                                 double after_m, std::size_t limit) {
  std::size_t begin = center;
  std::size_t end = center + 1;
  while (begin > 0 && frames_[center].path_m - frames_[begin - 1].path_m <= before_m) --begin;
  while (end < frames_.size() && frames_[end].path_m - frames_[center].path_m <= after_m) ++end;
  const std::size_t count = end - begin;
  const std::size_t taken = std::min(count, limit);
  std::vector<PlacedCloud> placed;
  for (std::size_t k = 0; k < taken; ++k) {
    const std::size_t index = begin + (2 * k + 1) * count / (2 * taken);
    placed.push_back({store_.get(index), chain_[center].inverse() * chain_[index]});
  }
  return placed;
}

LoopCandidate GlobalOptimizer::Implementation::examine(const LoopProposal& proposal) {
  const std::size_t to = frames_.size() - 1;
  const Eigen::Isometry3d T_predicted = poses_[proposal.from].inverse() * poses_[to];
  const LoopDecisions::PredictionSigma sigma = decisions_.prediction_sigma(frames_[to].path_m);
  RegistrationStart start;
  if (proposal.source == LoopSource::kDistance) {
    start.T_from_to = T_predicted;
    start.sigma_translation_m = sigma.translation_m;
    start.sigma_rotation_rad = sigma.rotation_rad;
  } else {
    start.T_from_to.linear() = rotation_between_places(frames_[proposal.from].T_odom_imu.linear(),
                                                       proposal.yaw_rad, frames_[to].T_odom_imu.linear());
    start.sigma_translation_m = kDescriptorSigmaM;
    start.sigma_rotation_rad = kDescriptorSigmaRad;
  }
  const double half_m = 0.5 * config_.submap_length_m;
  LoopCandidate candidate = verifier_.verify(
      submap(proposal.from, half_m, half_m, static_cast<std::size_t>(config_.submap_keyframes)),
      submap(to, kSourceLengthM, 0.0, kSourceKeyframes), start);
  candidate.stamp_from = frames_[proposal.from].stamp;
  candidate.stamp_to = frames_[to].stamp;
  candidate.source = proposal.source;
  candidate.measured.from = proposal.from;
  candidate.measured.to = to;
  const Vector6d error = difference(T_predicted, candidate.measured.T_from_to);
  const Matrix6d covariance = candidate.covariance + isotropic(sigma.rotation_rad, sigma.translation_m);
  candidate.chi_square = error.dot(covariance.ldlt().solve(error));
  return candidate;
}

Eigen::Isometry3d GlobalOptimizer::Implementation::correct(Stamp stamp,
                                                           const Eigen::Isometry3d& T_odom_imu) const {
  if (frames_.empty()) return T_odom_imu;
  const auto after =
      std::upper_bound(frames_.begin(), frames_.end(), stamp,
                       [](Stamp value, const OdometryFrame& frame) { return value < frame.stamp; });
  const std::size_t k = after == frames_.begin() ? 0 : static_cast<std::size_t>(after - frames_.begin()) - 1;
  return correction(k) * T_odom_imu;
}

GlobalOptimizer::GlobalOptimizer(const Config& config, Reporter* reporter)
    : implementation_(std::make_unique<Implementation>(config, reporter)) {}
GlobalOptimizer::~GlobalOptimizer() = default;

void GlobalOptimizer::add(Keyframe keyframe) { implementation_->add(std::move(keyframe)); }

void GlobalOptimizer::add_fix(const GnssFix& fix) { implementation_->measurements_.add_fix(fix); }
void GlobalOptimizer::add_external(const ExternalPose& pose) { implementation_->add_external(pose); }
void GlobalOptimizer::optimise() { implementation_->optimise(); }

void GlobalOptimizer::finish() {
  implementation_->clean_clouds(true);
  optimise();
  if (!implementation_->measurements_.has_external()) return;
  implementation_->reporter_->report(
      Severity::kInfo, "external_scale",
      "true way over the way that the other odometry says: " + std::to_string(external_scale()));
}
const std::vector<FixResult>& GlobalOptimizer::fixes() const {
  return implementation_->measurements_.fixes();
}

double GlobalOptimizer::external_scale() const { return implementation_->graph_.external_scale(); }

std::optional<GeodeticPoint> GlobalOptimizer::enu_origin() const {
  return implementation_->measurements_.enu_origin();
}

std::optional<EnuAlignment> GlobalOptimizer::alignment() const {
  if (!implementation_->measurements_.is_aligned()) return std::nullopt;
  return implementation_->measurements_.with_height(implementation_->graph_.alignment(),
                                                    implementation_->poses_);
}

Eigen::Isometry3d GlobalOptimizer::T_map_odom() const {
  if (size() == 0) return Eigen::Isometry3d::Identity();
  return implementation_->correction(size() - 1);
}

Eigen::Isometry3d GlobalOptimizer::correct(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const {
  return implementation_->correct(stamp, T_odom_imu);
}

const std::vector<LoopCandidate>& GlobalOptimizer::loops() const {
  return implementation_->decisions_.loops();
}
std::size_t GlobalOptimizer::size() const { return implementation_->frames_.size(); }
Stamp GlobalOptimizer::stamp(std::size_t keyframe) const {
  return implementation_->frames_.at(keyframe).stamp;
}
const Eigen::Isometry3d& GlobalOptimizer::T_odom_imu(std::size_t keyframe) const {
  return implementation_->frames_.at(keyframe).T_odom_imu;
}
Eigen::Isometry3d GlobalOptimizer::T_map_imu(std::size_t keyframe) const {
  return implementation_->poses_.at(keyframe);
}
std::shared_ptr<const KeyframeCloud> GlobalOptimizer::cloud(std::size_t keyframe) const {
  return implementation_->store_.get(keyframe);
}

std::size_t GlobalOptimizer::cleaned() const { return implementation_->ghosts_.given(); }

const PlaceDescriptor& GlobalOptimizer::place(std::size_t keyframe) const {
  return implementation_->detector_.place(keyframe);
}
double GlobalOptimizer::descriptor_range_m() const { return implementation_->config_.descriptor_range_m; }

std::size_t GlobalOptimizer::cloud_memory_bytes() const {
  return implementation_->store_.memory_limit_bytes();
}

GraphFile GlobalOptimizer::graph() const {
  GraphFile graph = {implementation_->poses_, implementation_->graph_.odometry(),
                     implementation_->graph_.loops()};
  // A session keeps no gravity: without it the steps have to say what it said.
  if (implementation_->is_levelled_) {
    for (RelativePose& step : graph.odometry)
      step.T_from_to = graph.poses[step.from].inverse() * graph.poses[step.to];
  }
  return graph;
}

}  // namespace fdi_lio::mapping
