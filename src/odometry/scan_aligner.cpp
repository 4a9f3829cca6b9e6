#include "fdi_lio/odometry/scan_aligner.hpp"

#include <cmath>
#include <cstddef>
#include <utility>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/turn_search.hpp"

namespace fdi_lio::odometry {

namespace {

/// Turns and steps that the IMU missed make it doubtful for longer from these on.
constexpr double kLeastMissedTurn = 0.02;  ///< [rad]
constexpr double kLeastMissedStep = 0.02;  ///< [m]
/// It may miss this before each of the next scans: what ShockGuard doubts without a scan's word is more.
constexpr double kDoubtfulVelocity = 1.0;  ///< [m/s]
/// What it may have missed at least, where it may have missed something: hardly anything holds the scan.
constexpr imu::MotionError kNear{0.03, 3.0};
/// So far, squared, the scan must be from what the IMU says, in the covariance of both and what scans misfit
/// by.
constexpr double kMissedSq = 25.0;
/// Where it stepped, surfaces must hold it by so many times what their noise alone would: on an open road
/// vehicles that set off together with the sensor say that it stands.
constexpr double kHeld = 4.0;
/// Trust in the IMU hides what it misses: a scan that contradicts it has little weight. So one is asked that
/// is only so sudden, and so many after it.
constexpr double kNoticeable = 0.2;
constexpr int kWatchedScans = 2;
/// What explains a scan finds so much of the least share of matches that is usual: that falls by a tenth
/// within a few scans where a corridor bends.
constexpr double kExplained = 0.8;
/// A larger turn is believed if it finds more matches, by so many standard deviations of their number;
/// soon after another by fewer.
constexpr double kGain = 6.0;
constexpr double kNextGain = 2.0;

double match_count(const Alignment& alignment) {
  return static_cast<double>(alignment.information.planes + alignment.information.edges);
}

std::size_t feature_count(const matching::MatchInput& features) {
  return features.planes.size() + features.edges.size();
}

/// Matches for each feature.
double matched_share(const Alignment& alignment, const matching::MatchInput& features) {
  return match_count(alignment) / static_cast<double>(feature_count(features));
}

/// A velocity that is off by so much in whatever instant of an interval makes a step of this length of it, in
/// the root mean square.
double velocity_error(const Eigen::Vector3d& step, double duration_s) {
  return std::max(kNear.velocity_mps, std::sqrt(3.0) * step.norm() / duration_s);
}

/// Of the newest states, order [dtheta (body), dt (odom)].
Vector6d difference(const Smoother& from, const Smoother& to) {
  return fdi_lio::difference(from.newest().T_odom_imu(), to.newest().T_odom_imu());
}

Matrix6d pose_covariance(const Smoother& smoother) { return smoother.covariance().topLeftCorner<6, 6>(); }

/// Whether surfaces hold the scan along `step` (IMU axes): along the axis of the alignment that is nearest to
/// it.
bool is_held_along(const Eigen::Vector3d& step, const Alignment& alignment) {
  Eigen::Index axis = 0;
  (step.transpose() * alignment.status.axes.bottomRows<3>()).cwiseAbs().maxCoeff(&axis);
  return alignment.axis_information[axis] >= kHeld * alignment.axis_noise[axis];
}

}  // namespace

ScanAligner::ScanAligner(const Config& config, ShockGuard* shock_guard, Reporter* reporter)
    : mapping_(config.mapping),
      sensor_(config.sensor),
      T_imu_lidar_(config.sensor.T_imu_lidar()),
      registration_(config, reporter),
      health_(reporter),
      shock_guard_(shock_guard) {}

matching::MatchInput ScanAligner::match_input(const FeatureSet& features, const AlignerInput& input) const {
  return matching::make_match_input(features, mapping_, T_imu_lidar_, input.adapted.feature_voxel_m);
}

Alignment ScanAligner::align_expected(const AlignerInput& input, const matching::MatchInput& features,
                                      const Expectation& expectation, Smoother* smoother,
                                      Registration* registration) const {
  return registration->align(features, input.map, input.adapted,
                             health_.least_matches(feature_count(features)), expectation, smoother);
}

/// Aligns the scan after another motion than the IMU tells, and the motion before it may be off as well.
ScanAligner::Trial ScanAligner::align_after(const imu::Preintegration& motion,
                                            const imu::MotionError& error_before, const AlignerInput& input,
                                            const matching::MatchInput& features, Expectation expectation,
                                            const Smoother& predicted) const {
  Trial trial{{}, predicted, registration_};
  trial.smoother.replace_newest(imu::predict(input.before, motion), motion, error_before);
  expectation.covariance = pose_covariance(trial.smoother);
  trial.alignment = align_expected(input, features, expectation, &trial.smoother, &trial.registration);
  return trial;
}

/// Aligns the scan after what the IMU has missed.
ScanAligner::Trial ScanAligner::align_missed(const Missed& missed, const AlignerInput& input,
                                             const matching::MatchInput& features,
                                             const Smoother& predicted) const {
  Expectation expectation;
  expectation.is_unreliable = true;
  if (!missed.turn) {
    const imu::MotionError error{0.0, missed.velocity_mps};
    return align_after(imu::with_error(*input.imu, error), error, input, features, expectation, predicted);
  }
  expectation.missed_turn = *missed.turn;
  expectation.missed_turn_before = shock_guard_->doubtful_turn();
  const imu::Preintegration motion =
      imu::with_error(imu::with_missed_turn(*input.imu, *missed.turn), {0.0, missed.velocity_mps});
  const FeatureSet turned =
      turned_while_scanned(input.features, *missed.turn, input.imu->duration_s(), T_imu_lidar_);
  return align_after(motion, {missed.turn->norm(), missed.velocity_mps}, input, match_input(turned, input),
                     expectation, predicted);
}

/// What the scan asks for where it need not heed the IMU, as far as that does not explain it. Planes are
/// sought no farther away than ever: on open roads chance finds anything there.
ScanAligner::Missed ScanAligner::find_missed(const AlignerInput& input, const matching::MatchInput& features,
                                             const Smoother& predicted) const {
  const Trial trial = align_after(imu::with_error(*input.imu, kNear), kNear, input, features, {}, predicted);
  Missed missed;
  if (!trial.alignment.is_healthy) return missed;
  const Vector6d missing = difference(predicted, trial.smoother);
  const Eigen::Vector3d turn = missing.head<3>();
  const Eigen::Vector3d step = missing.tail<3>();
  const Matrix6d covariance =
      pose_covariance(predicted) + pose_covariance(trial.smoother) + HealthMonitor::misfit();
  if (turn.dot(covariance.topLeftCorner<3, 3>().ldlt().solve(turn)) >= kMissedSq) missed.turn = turn;
  if (step.dot(covariance.bottomRightCorner<3, 3>().ldlt().solve(step)) >= kMissedSq &&
      is_held_along(predicted.newest().q_odom_imu.conjugate() * step, trial.alignment)) {
    missed.velocity_mps = velocity_error(step, input.imu->duration_s());
  }
  return missed;
}

/// The scan once more, after a motion that the IMU has missed, where one explains more of it than `alignment`
/// does. `predicted`: before the scan was aligned. Returns what was missed; if nothing, all is as it was.
ScanAligner::Missed ScanAligner::take_missed(const AlignerInput& input, const matching::MatchInput& features,
                                             const Smoother& predicted, const Doubt& doubt,
                                             Alignment* alignment, Smoother* smoother) {
  const auto takes = [&](const Missed& missed, double least_matches) {
    Trial trial = align_missed(missed, input, features, predicted);
    if (!trial.alignment.is_healthy || match_count(trial.alignment) < least_matches) return false;
    *alignment = std::move(trial.alignment);
    *smoother = std::move(trial.smoother);
    registration_ = std::move(trial.registration);
    return true;
  };
  const double matches = match_count(*alignment);
  // By so many more or fewer a second alignment differs by chance.
  const double share = matched_share(*alignment, features);
  const double deviation = std::sqrt(share * (1.0 - share) * static_cast<double>(feature_count(features)));
  const auto turn = doubt.of_large_turns
                        ? find_turn(input.map.planes(), features.planes, predicted.newest().T_odom_imu())
                        : std::nullopt;
  if (turn) {
    const double gain = shock_guard_->is_gyro_doubtful() ? kNextGain : kGain;
    const Missed missed{turn, 0.0};
    if (takes(missed, matches + gain * deviation)) return missed;
  }
  // What explains a scan leaves nothing unusual about it: within a larger turn, steps match something, too.
  const Missed missed = find_missed(input, features, predicted);
  const double least_share = kExplained * health_.least_usual_share();
  const double least_matches = least_share * static_cast<double>(feature_count(features));
  const bool has_missed = missed.turn || missed.velocity_mps > 0.0;
  return has_missed && takes(missed, std::max(matches - deviation, least_matches)) ? missed : Missed();
}

/// Whether the IMU may have missed something before a scan that was aligned as predicted.
ScanAligner::Doubt ScanAligner::doubt_imu(const Alignment& alignment, const matching::MatchInput& features,
                                          const std::optional<HealthMonitor::Prediction>& prediction,
                                          const imu::NavState& state) {
  const double suddenness = prediction ? health_.suddenness(*prediction, state) : 0.0;
  const bool is_conspicuous =
      suddenness > 1.0 || matched_share(alignment, features) < health_.least_usual_share();
  const bool is_noticeable = is_conspicuous || suddenness > kNoticeable;
  watched_scans_ = is_noticeable ? kWatchedScans + 1 : std::max(0, watched_scans_ - 1);
  Doubt doubt;
  doubt.of_large_turns = shock_guard_->is_gyro_doubtful() || is_conspicuous;
  doubt.of_anything = doubt.of_large_turns || (watched_scans_ > 0 && health_.is_well_known());
  return doubt;
}

/// What was missed makes the IMU doubtful, and what it misses while it is doubtful; returns whether any was.
/// `missing`: of the prediction, [dtheta (body), dt (odom)].
bool ScanAligner::note_missed(const Missed& missed, const Vector6d& missing) {
  const Eigen::Vector3d turn = missing.head<3>();
  const Eigen::Vector3d step = missing.tail<3>();
  const bool has_turned = missed.turn || (shock_guard_->is_gyro_doubtful() && turn.norm() > kLeastMissedTurn);
  const bool has_stepped =
      missed.velocity_mps > 0.0 || (shock_guard_->is_accel_doubtful() && step.norm() > kLeastMissedStep);
  if (has_turned) shock_guard_->note_missed_turn(turn);
  if (has_stepped) shock_guard_->note_missed_step(step.norm(), kDoubtfulVelocity);
  return has_turned || has_stepped;
}

Alignment ScanAligner::align(const AlignerInput& input, Smoother* smoother) {
  const matching::MatchInput features = match_input(input.features, input);
  Expectation expectation;
  expectation.is_unreliable = input.is_unpredicted || shock_guard_->is_shocked();
  if (shock_guard_->is_gyro_doubtful()) {
    expectation.missed_turn = Eigen::Vector3d::Zero();
    expectation.missed_turn_before = shock_guard_->doubtful_turn();
  }
  std::optional<Smoother> predicted;
  std::optional<HealthMonitor::Prediction> prediction;
  if (smoother->newest().imu_status == imu::ImuStatus::kInitialised) {
    predicted = *smoother;
    expectation.covariance = pose_covariance(*smoother);
    const bool is_shaken = input.imu && imu::is_shaken(sensor_, input.imu->recent);
    prediction = HealthMonitor::Prediction{smoother->newest().T_odom_imu(), *expectation.covariance,
                                           is_shaken || shock_guard_->is_shocked()};
  }
  Alignment alignment = align_expected(input, features, expectation, smoother, &registration_);
  const Doubt doubt = doubt_imu(alignment, features, prediction, smoother->newest());
  if (predicted && input.imu && input.imu->sample_count > 0) {
    const Missed missed =
        doubt.of_anything ? take_missed(input, features, *predicted, doubt, &alignment, smoother) : Missed();
    if (note_missed(missed, difference(*predicted, *smoother))) prediction.reset();
  }
  if (alignment.is_healthy) {
    health_.add(prediction, smoother->newest(), matched_share(alignment, features));
  } else {
    health_.add_unmatched();
  }
  return alignment;
}

}  // namespace fdi_lio::odometry
