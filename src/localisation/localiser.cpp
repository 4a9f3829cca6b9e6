#include "fdi_lio/localisation/localiser.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/localisation/brightness_match.hpp"
#include "fdi_lio/localisation/place_hypothesis.hpp"
#include "fdi_lio/mapping/loop_verifier.hpp"

namespace fdi_lio::localisation {

namespace {

constexpr double kDegree = M_PI / 180.0;
/// The descriptor's place may be so far from the keyframe's.
constexpr double kDescriptorSigmaM = 3.0;
constexpr double kDescriptorSigmaRad = 4.0 * kDegree;
/// Scans so far back that are registered together with the newest one.
constexpr double kSourceLengthM = 5.0;
constexpr std::size_t kSourceScans = 4;
/// A scan that is nearer to the one before replaces it.
constexpr double kNewScanM = 0.5;
/// Places in the session that are nearer to each other are one candidate of the search.
constexpr double kApartM = 5.0;
/// Surfaces so near the newest scan are compared in brightness.
constexpr double kBrightnessRadiusM = 12.0;
/// What a registration can be off by without being wrong, besides its covariance.
constexpr double kBaseSigmaM = 0.1;
constexpr double kBaseSigmaRad = 0.5 * kDegree;
/// A hypothesis that a registration moves farther is of another place than before.
constexpr double kOtherPlaceM = 3.0 * kBaseSigmaM;
/// Roll and pitch of a new hypothesis: gravity gives them, to the session and to the odometry.
constexpr double kLevelSigmaRad = 1.0 * kDegree;
/// Step of the headings about an expected one: what the search of a registration covers.
constexpr double kHeadingStepRad = 0.3;
/// A heading that is nearer to that of a hypothesis is not looked at again.
constexpr double kSameLookRad = 12.0 * kDegree;
/// The same for a place that looks alike: a hypothesis of the next door does not stand for it.
constexpr double kSameLookM = 1.5;
/// How far a hypothesis is looked for about where it is: other places are hypotheses of their own.
constexpr double kModeSigmaM = 0.5;
/// What the search of a registration covers at most.
constexpr double kMaxSigmaM = 2.7;
/// Failed registrations in a row that end the hypothesis of a place.
constexpr int kHypothesisFailures = 2;

}  // namespace

const char* to_text(LocalisationState state) {
  static constexpr const char* kTexts[] = {"searching", "confirming", "tracking", "lost"};
  return kTexts[static_cast<int>(state)];
}

class Localiser::Implementation {
 public:
  Implementation(const Config& config, mapping::Session session, Reporter* reporter)
      : config_(config),
        reporter_(reporter),
        session_(std::move(session), config.loop.cloud_memory_mb),
        verifier_(config) {}

  bool is_due(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const;
  std::optional<LocalisationResult> add(const mapping::Keyframe& scan);
  void reset();
  void set_initial_pose(const InitialPose& pose) {
    given_ = pose;
    registered_at_.reset();
  }
  std::optional<Eigen::Isometry3d> T_map_odom() const {
    if (!estimate_) return std::nullopt;
    return estimate_->T_map_odom;
  }
  LocalisationState state() const { return state_; }
  SessionMap& session() { return session_; }

 private:
  struct Recent {
    Eigen::Isometry3d T_odom_imu;
    double way_m;
    std::shared_ptr<const mapping::KeyframeCloud> cloud;
  };

  void remember(const mapping::Keyframe& scan);
  void expect(const InitialPose& pose);
  Eigen::Isometry3d T_odom_imu() const { return recent_.back().T_odom_imu; }
  std::vector<mapping::PlacedCloud> source() const;
  Matrix6d predicted_covariance(const PlaceEstimate& estimate) const;
  mapping::LoopCandidate register_at(const Eigen::Isometry3d& T_map_imu, double sigma_m, double sigma_rad);
  mapping::LoopCandidate correct(PlaceEstimate* estimate, double max_sigma_m);
  mapping::LoopCandidate track();
  mapping::LoopCandidate search(Stamp stamp);
  void check(PlaceHypothesis* hypothesis, Stamp stamp, mapping::LoopCandidate* newest);
  bool is_looked_at(const Eigen::Isometry3d& T_map_imu, double radius_m) const;
  std::vector<PlaceHypothesis> look_at(const Eigen::Isometry3d& T_map_imu, double sigma_m, double sigma_rad,
                                       double known_sigma_m, Stamp stamp, mapping::LoopCandidate* newest);
  void look_where_expected(Stamp stamp, mapping::LoopCandidate* newest);
  void look_where_alike(Stamp stamp, mapping::LoopCandidate* newest);
  void decide(Stamp stamp);

  Config config_;
  Reporter* reporter_;
  SessionMap session_;
  mapping::LoopVerifier verifier_;
  LocalisationState state_ = LocalisationState::kSearching;
  std::optional<PlaceEstimate> estimate_;  ///< once found
  std::vector<PlaceHypothesis> hypotheses_;
  std::optional<InitialPose> given_;
  std::optional<PlaceExpectation> expectation_;
  std::deque<Recent> recent_;
  std::optional<Stamp> registered_at_;
  double registered_at_m_ = 0.0;
  int failures_ = 0;
};

void Localiser::Implementation::reset() {
  state_ = LocalisationState::kSearching;
  estimate_.reset();
  hypotheses_.clear();
  given_.reset();
  expectation_.reset();
  recent_.clear();
  registered_at_.reset();
  registered_at_m_ = 0.0;
  failures_ = 0;
}

bool Localiser::Implementation::is_due(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const {
  if (!registered_at_ || recent_.empty()) return true;
  const double waited_s = seconds_between(*registered_at_, stamp);
  if (state_ != LocalisationState::kTracking) return waited_s >= config_.localisation.search_period_s;
  const double step_m = (T_odom_imu.translation() - recent_.back().T_odom_imu.translation()).norm();
  return waited_s >= config_.localisation.period_s ||
         recent_.back().way_m + step_m - registered_at_m_ >= config_.localisation.distance_m;
}

void Localiser::Implementation::expect(const InitialPose& pose) {
  hypotheses_.clear();
  estimate_.reset();
  state_ = LocalisationState::kSearching;
  Eigen::Isometry3d T_map_imu = Eigen::Isometry3d::Identity();
  T_map_imu.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix() *
                       mapping::levelled(T_odom_imu().linear());
  T_map_imu.translation() = Eigen::Vector3d(pose.x_m, pose.y_m, session_.height_at({pose.x_m, pose.y_m}));
  expectation_ = PlaceExpectation{
      T_map_imu * T_odom_imu().inverse(), pose.sigma_m, pose.sigma_rad, recent_.back().way_m, true,
      config_.localisation.max_failures};
}

void Localiser::Implementation::remember(const mapping::Keyframe& scan) {
  double way_m = 0.0;
  if (!recent_.empty()) {
    const double step_m = (scan.T_odom_imu.translation() - T_odom_imu().translation()).norm();
    way_m = recent_.back().way_m + step_m;
    const bool is_only = recent_.size() == 1;
    if (!is_only && way_m - recent_[recent_.size() - 2].way_m < kNewScanM) recent_.pop_back();
  }
  recent_.push_back({scan.T_odom_imu, way_m, std::make_shared<const mapping::KeyframeCloud>(scan.cloud)});
  while (way_m - recent_.front().way_m > kSourceLengthM) recent_.pop_front();
}

/// The newest scans, in the IMU frame of the newest.
std::vector<mapping::PlacedCloud> Localiser::Implementation::source() const {
  std::vector<mapping::PlacedCloud> placed;
  const std::size_t taken = std::min(recent_.size(), kSourceScans);
  for (std::size_t k = 0; k < taken; ++k) {
    // The newest is always among them.
    const Recent& each = recent_[recent_.size() - 1 - k * recent_.size() / taken];
    placed.push_back({each.cloud, T_odom_imu().inverse() * each.T_odom_imu});
  }
  return placed;
}

/// The odometry's drift since the last registration makes an estimate less sure.
Matrix6d Localiser::Implementation::predicted_covariance(const PlaceEstimate& estimate) const {
  const double way_m = recent_.back().way_m - estimate.way_m;
  const double turn = config_.loop.drift_rotation_deg_per_m * kDegree * way_m;
  // What the heading is off by leads aside on the way.
  const double aside = way_m * std::sqrt(estimate.covariance.topLeftCorner<3, 3>().trace());
  return estimate.covariance +
         isotropic(kBaseSigmaRad + turn, kBaseSigmaM + config_.loop.drift_share * way_m + aside);
}

/// Registers the newest scans with the session about `T_map_imu`. `measured` is the pose in map, `covariance`
/// of it.
mapping::LoopCandidate Localiser::Implementation::register_at(const Eigen::Isometry3d& T_map_imu,
                                                              double sigma_m, double sigma_rad) {
  const std::size_t center = session_.nearest(T_map_imu.translation());
  const Eigen::Isometry3d& T_map_center = session_.T_map_imu(center);
  const mapping::RegistrationStart start = {T_map_center.inverse() * T_map_imu, sigma_m, sigma_rad};
  const std::vector<mapping::PlacedCloud> submap = session_.submap(
      center, config_.localisation.submap_radius_m, static_cast<std::size_t>(config_.loop.submap_keyframes));
  const std::vector<mapping::PlacedCloud> scans = source();
  mapping::LoopCandidate candidate = verifier_.verify(submap, scans, start);
  if (state_ != LocalisationState::kTracking && candidate.verdict == mapping::LoopVerdict::kPending)
    candidate.surface_correlation = match_brightness(submap, scans, candidate.measured.T_from_to,
                                                     config_.mapping.output_map_voxel_m, kBrightnessRadiusM)
                                        .correlation;
  Matrix6d to_map = Matrix6d::Identity();
  to_map.bottomRightCorner<3, 3>() = T_map_center.linear();
  candidate.covariance = to_map * candidate.covariance * to_map.transpose();
  candidate.measured.T_from_to = T_map_center * candidate.measured.T_from_to;
  for (Eigen::Vector3d& apart : candidate.alternatives) apart = T_map_center.linear() * apart;
  return candidate;
}

/// Registers the newest scans where `estimate` puts them and corrects it: in each direction as far as the
/// registration knows it. The verdict is kAccepted when it did. Looks no farther than for `max_sigma_m`.
mapping::LoopCandidate Localiser::Implementation::correct(PlaceEstimate* estimate, double max_sigma_m) {
  const Eigen::Isometry3d T_predicted = estimate->T_map_odom * T_odom_imu();
  const Matrix6d P = predicted_covariance(*estimate);
  mapping::LoopCandidate candidate =
      register_at(T_predicted, std::min(largest_sigma(P.bottomRightCorner<3, 3>()), max_sigma_m),
                  largest_sigma(P.topLeftCorner<3, 3>()));
  if (candidate.verdict != mapping::LoopVerdict::kPending) return candidate;
  const Vector6d error = difference(T_predicted, candidate.measured.T_from_to);
  const Eigen::LDLT<Matrix6d> solver(P + candidate.covariance);
  candidate.chi_square = error.dot(solver.solve(error));
  if (candidate.chi_square > config_.loop.max_chi_square) {
    candidate.verdict = mapping::LoopVerdict::kFarFromPrediction;
    return candidate;
  }
  candidate.verdict = mapping::LoopVerdict::kAccepted;
  const Matrix6d gain = solver.solve(P).transpose();
  estimate->T_map_odom = moved(T_predicted, gain * error) * T_odom_imu().inverse();
  estimate->covariance = P - gain * P;
  estimate->covariance = 0.5 * (estimate->covariance + estimate->covariance.transpose()).eval();
  estimate->way_m = recent_.back().way_m;
  return candidate;
}

std::optional<LocalisationResult> Localiser::Implementation::add(const mapping::Keyframe& scan) {
  const bool is_registered = is_due(scan.stamp, scan.T_odom_imu);
  remember(scan);
  if (!is_registered) return std::nullopt;
  registered_at_ = scan.stamp;
  registered_at_m_ = recent_.back().way_m;
  if (given_) expect(*given_);
  given_.reset();
  LocalisationResult result;
  result.registration = state_ == LocalisationState::kTracking ? track() : search(scan.stamp);
  result.stamp = scan.stamp;
  result.registration.stamp_to = scan.stamp;
  result.state = state_;
  result.failures = failures_;
  if (estimate_) result.covariance = predicted_covariance(*estimate_);
  return result;
}

mapping::LoopCandidate Localiser::Implementation::track() {
  const mapping::LoopCandidate candidate = correct(&*estimate_, kMaxSigmaM);
  failures_ = candidate.verdict == mapping::LoopVerdict::kAccepted ? 0 : failures_ + 1;
  if (failures_ < config_.localisation.max_failures) return candidate;
  state_ = LocalisationState::kLost;
  reporter_->report(Severity::kWarning, "localisation_lost",
                    "the place in the session is lost: the last registrations failed with " +
                        std::string(to_text(candidate.verdict)));
  const Matrix6d P = predicted_covariance(*estimate_);
  expectation_ = PlaceExpectation{estimate_->T_map_odom,
                                  largest_sigma(P.bottomRightCorner<3, 3>()),
                                  largest_sigma(P.topLeftCorner<3, 3>()),
                                  recent_.back().way_m,
                                  false,
                                  0};
  return candidate;
}

/// Registers the scan with the hypotheses, and looks for more.
mapping::LoopCandidate Localiser::Implementation::search(Stamp stamp) {
  mapping::LoopCandidate newest;
  newest.verdict = mapping::LoopVerdict::kLowOverlap;
  for (PlaceHypothesis& hypothesis : hypotheses_) check(&hypothesis, stamp, &newest);
  hypotheses_.erase(
      std::remove_if(hypotheses_.begin(), hypotheses_.end(),
                     [](const PlaceHypothesis& each) { return each.failures >= kHypothesisFailures; }),
      hypotheses_.end());
  look_where_expected(stamp, &newest);
  const bool is_given = expectation_ && expectation_->is_given;
  if (is_given && hypotheses_.empty() && --expectation_->tries == 0) expectation_.reset();
  if (!is_given) look_where_alike(stamp, &newest);
  join_equal(T_odom_imu(), &hypotheses_);
  if (state_ != LocalisationState::kLost)
    state_ = hypotheses_.empty() ? LocalisationState::kSearching : LocalisationState::kConfirming;
  decide(stamp);
  return newest;
}

/// Registers the scan where a hypothesis puts it. What moved (or waited) long enough confirms it once more.
void Localiser::Implementation::check(PlaceHypothesis* hypothesis, Stamp stamp,
                                      mapping::LoopCandidate* newest) {
  const Eigen::Isometry3d T_predicted = hypothesis->estimate.T_map_odom * T_odom_imu();
  const mapping::LoopCandidate candidate = correct(&hypothesis->estimate, kModeSigmaM);
  if (candidate.wall_share >= newest->wall_share) *newest = candidate;
  const Eigen::Isometry3d T_corrected = hypothesis->estimate.T_map_odom * T_odom_imu();
  if ((T_corrected.translation() - T_predicted.translation()).norm() > kOtherPlaceM) hypothesis->begin_anew();
  hypothesis->add(candidate);
  if (candidate.verdict != mapping::LoopVerdict::kAccepted) return;
  const double share = 1.0 / config_.localisation.confirmations;
  const bool is_new =
      recent_.back().way_m - hypothesis->confirmed_at_m >= share * config_.localisation.confirm_distance_m ||
      seconds_between(hypothesis->confirmed_at, stamp) >= share * config_.localisation.confirm_time_s;
  if (!is_new) return;
  ++hypothesis->confirmations;
  hypothesis->confirmed_at = stamp;
  hypothesis->confirmed_at_m = recent_.back().way_m;
}

/// Whether a hypothesis is there already.
bool Localiser::Implementation::is_looked_at(const Eigen::Isometry3d& T_map_imu, double radius_m) const {
  return std::any_of(hypotheses_.begin(), hypotheses_.end(), [&](const PlaceHypothesis& each) {
    const Vector6d apart = difference(each.estimate.T_map_odom * T_odom_imu(), T_map_imu);
    return apart.tail<3>().norm() < radius_m && apart.head<3>().norm() < kSameLookRad;
  });
}

/// A hypothesis for each place about `T_map_imu` that the scan fits.
std::vector<PlaceHypothesis> Localiser::Implementation::look_at(const Eigen::Isometry3d& T_map_imu,
                                                                double sigma_m, double sigma_rad,
                                                                double known_sigma_m, Stamp stamp,
                                                                mapping::LoopCandidate* newest) {
  std::vector<PlaceHypothesis> hypotheses;
  const mapping::LoopCandidate found = register_at(T_map_imu, sigma_m, sigma_rad);
  if (found.wall_share >= newest->wall_share) *newest = found;
  if (found.verdict != mapping::LoopVerdict::kPending) return hypotheses;
  std::vector<Eigen::Vector3d> shifts = found.alternatives;
  shifts.insert(shifts.begin(), Eigen::Vector3d::Zero());
  for (const Eigen::Vector3d& shift : shifts) {
    Eigen::Isometry3d T_map_mode = found.measured.T_from_to;
    T_map_mode.translation() += shift;
    PlaceHypothesis hypothesis;
    hypothesis.estimate.T_map_odom = T_map_mode * T_odom_imu().inverse();
    // As wide as the search: what this registration does not determine is not known.
    hypothesis.estimate.covariance = isotropic(kLevelSigmaRad, sigma_m);
    const Eigen::Vector3d up_imu = T_map_mode.linear().row(2);
    hypothesis.estimate.covariance.topLeftCorner<3, 3>() +=
        sigma_rad * sigma_rad * up_imu * up_imu.transpose();
    hypothesis.estimate.way_m = hypothesis.found_at_m = hypothesis.confirmed_at_m = recent_.back().way_m;
    hypothesis.found_at = hypothesis.confirmed_at = stamp;
    const mapping::LoopCandidate candidate = correct(&hypothesis.estimate, kModeSigmaM);
    if (candidate.verdict != mapping::LoopVerdict::kAccepted) continue;
    hypothesis.add(candidate);
    hypothesis.known_sigma_m = known_sigma_m;
    hypotheses.push_back(hypothesis);
  }
  return hypotheses;
}

void Localiser::Implementation::look_where_expected(Stamp stamp, mapping::LoopCandidate* newest) {
  if (!expectation_) return;
  const double way_m = recent_.back().way_m - expectation_->way_m;
  const double sigma_m = std::min(expectation_->sigma_m + config_.loop.drift_share * way_m, kMaxSigmaM);
  const int turns = static_cast<int>(std::ceil(2.0 * expectation_->sigma_rad / kHeadingStepRad - 0.5));
  const Eigen::Isometry3d T_map_imu = expectation_->T_map_odom * T_odom_imu();
  for (int turn = -turns; turn <= turns; ++turn) {
    Eigen::Isometry3d T = T_map_imu;
    T.linear() = Eigen::AngleAxisd(turn * kHeadingStepRad, Eigen::Vector3d::UnitZ()) * T_map_imu.linear();
    if (is_looked_at(T, 2.0 * sigma_m)) continue;
    for (PlaceHypothesis& each :
         look_at(T, sigma_m, 0.5 * kHeadingStepRad, needed_sigma_m(sigma_m), stamp, newest)) {
      each.is_given = expectation_->is_given;
      hypotheses_.push_back(each);
    }
  }
}

void Localiser::Implementation::look_where_alike(Stamp stamp, mapping::LoopCandidate* newest) {
  const mapping::PlaceDescriptor place =
      session_.describe(recent_.back().cloud->surface, T_odom_imu().linear());
  const auto limit = static_cast<std::size_t>(config_.localisation.search_candidates);
  for (const mapping::AlikePlace& alike :
       session_.alike(place, config_.loop.descriptor_max_distance, limit, kApartM)) {
    Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
    T_from_to.linear() = session_.turned(alike.index, alike.match.yaw_rad, T_odom_imu().linear());
    const Eigen::Isometry3d T_map_imu = session_.T_map_imu(alike.index) * T_from_to;
    if (is_looked_at(T_map_imu, kSameLookM)) continue;
    for (const PlaceHypothesis& each :
         look_at(T_map_imu, kDescriptorSigmaM, kDescriptorSigmaRad, needed_sigma_m(0.0), stamp, newest))
      hypotheses_.push_back(each);
  }
}

/// Believes the best hypothesis when no other place fits nearly as well.
void Localiser::Implementation::decide(Stamp stamp) {
  const PlaceHypothesis* best =
      believed(hypotheses_, expectation_, {stamp, T_odom_imu(), recent_.back().way_m}, config_.localisation);
  if (best == nullptr) return;
  estimate_ = best->estimate;
  hypotheses_.clear();
  expectation_.reset();
  failures_ = 0;
  state_ = LocalisationState::kTracking;
  reporter_->report(Severity::kInfo, "localisation_found", "the place in the session is found");
}

Localiser::Localiser(const Config& config, mapping::Session session, Reporter* reporter)
    : implementation_(std::make_unique<Implementation>(config, std::move(session), reporter)) {}
Localiser::~Localiser() = default;

bool Localiser::is_due(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const {
  return implementation_->is_due(stamp, T_odom_imu);
}
std::optional<LocalisationResult> Localiser::add(const mapping::Keyframe& scan) {
  return implementation_->add(scan);
}
void Localiser::set_initial_pose(const InitialPose& pose) { implementation_->set_initial_pose(pose); }
std::optional<Eigen::Isometry3d> Localiser::T_map_odom() const { return implementation_->T_map_odom(); }
LocalisationState Localiser::state() const { return implementation_->state(); }
void Localiser::reset() { implementation_->reset(); }
SessionMap& Localiser::session() { return implementation_->session(); }

}  // namespace fdi_lio::localisation
