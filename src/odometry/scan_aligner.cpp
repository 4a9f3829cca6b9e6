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

/// A turn that the gyro missed makes it doubtful for longer from this on [rad].
constexpr double kLeastMissedTurn = 0.02;
/// One that planes a step apart do not show is what the scan turns by if the gyro may be off by so much
/// [rad], if that is so far from what it says, squared, in the covariance of both and what scans misfit by
/// [rad].
constexpr double kNearTurn = 0.03;
constexpr double kNearTurnSq = 25.0;
constexpr double kMisfit = 1e-3;
/// One of any size is believed if it finds more matches, by so many standard deviations of their number; soon
/// after another by fewer.
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

/// Of the newest state of one against the other's (body frame).
Eigen::Vector3d turn_between(const Smoother& from, const Smoother& to) {
  return so3::log(Eigen::Quaterniond(from.newest().q_odom_imu.conjugate() * to.newest().q_odom_imu));
}

Matrix6d pose_covariance(const Smoother& smoother) { return smoother.covariance().topLeftCorner<6, 6>(); }

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

/// Aligns the scan as it is after another motion than the IMU tells, which may be turned by `turn_error_rad`
/// besides, and so may the motion before it.
ScanAligner::Trial ScanAligner::align_after(const imu::Preintegration& motion, double turn_error_rad,
                                            const AlignerInput& input, const matching::MatchInput& features,
                                            Expectation expectation, const Smoother& predicted) {
  Trial trial{{}, predicted, registration_};
  trial.smoother.replace_newest(imu::predict(input.before, motion), motion, turn_error_rad);
  expectation.covariance = pose_covariance(trial.smoother);
  expectation.is_unreliable = true;
  trial.alignment = align_expected(input, features, expectation, &trial.smoother, &trial.registration);
  return trial;
}

ScanAligner::Trial ScanAligner::align_turned(const Eigen::Vector3d& turn, const AlignerInput& input,
                                             const Smoother& predicted) {
  Expectation expectation;
  expectation.missed_turn = turn;
  expectation.missed_turn_before = shock_guard_->doubtful_turn();
  const FeatureSet turned = turned_while_scanned(input.features, turn, input.imu->duration_s(), T_imu_lidar_);
  return align_after(imu::with_missed_turn(*input.imu, turn), turn.norm(), input, match_input(turned, input),
                     expectation, predicted);
}

/// The turn that the scan asks for where it need not heed the gyro, if the gyro does not explain it.
std::optional<Eigen::Vector3d> ScanAligner::find_near_turn(const AlignerInput& input,
                                                           const matching::MatchInput& features,
                                                           const Smoother& predicted) {
  const imu::Preintegration motion = imu::with_turn_error(*input.imu, kNearTurn);
  const Trial trial = align_after(motion, kNearTurn, input, features, {}, predicted);
  if (!trial.alignment.is_healthy) return std::nullopt;
  const Eigen::Vector3d turn = turn_between(predicted, trial.smoother);
  const Eigen::Matrix3d covariance =
      (pose_covariance(predicted) + pose_covariance(trial.smoother)).topLeftCorner<3, 3>() +
      std::pow(kMisfit, 2) * Eigen::Matrix3d::Identity();
  if (turn.dot(covariance.ldlt().solve(turn)) < kNearTurnSq) return std::nullopt;
  return turn;
}

/// The scan once more, after a turn that the gyro has missed, where one explains more of it than `alignment`
/// does. `predicted`: before the scan was aligned. Returns whether there is one; if not, all is as it was.
bool ScanAligner::take_missed_turn(const AlignerInput& input, const matching::MatchInput& features,
                                   const Smoother& predicted, Alignment* alignment, Smoother* smoother) {
  const auto take = [&](Trial&& trial) {
    *alignment = std::move(trial.alignment);
    *smoother = std::move(trial.smoother);
    registration_ = std::move(trial.registration);
  };
  if (const auto turn = find_turn(input.map.planes(), features.planes, predicted.newest().T_odom_imu())) {
    // Were it chance, so many would be found as were without.
    const double share = matched_share(*alignment, features);
    const double deviation = std::sqrt(share * (1.0 - share) * static_cast<double>(feature_count(features)));
    const double gain = shock_guard_->is_gyro_doubtful() ? kNextGain : kGain;
    Trial trial = align_turned(*turn, input, predicted);
    if (trial.alignment.is_healthy &&
        match_count(trial.alignment) > match_count(*alignment) + gain * deviation) {
      take(std::move(trial));
      return true;
    }
  }
  if (const auto turn = find_near_turn(input, features, predicted)) {
    Trial trial = align_turned(*turn, input, predicted);
    if (trial.alignment.is_healthy && match_count(trial.alignment) >= match_count(*alignment)) {
      take(std::move(trial));
      return true;
    }
  }
  return false;
}

Alignment ScanAligner::align(const AlignerInput& input, Smoother* smoother) {
  const matching::MatchInput features = match_input(input.features, input);
  const bool has_gyro = input.imu && input.imu->sample_count > 0;
  const bool is_gyro_doubtful = shock_guard_->is_gyro_doubtful();
  Expectation expectation;
  expectation.is_unreliable = input.is_unpredicted || shock_guard_->is_shocked();
  if (is_gyro_doubtful) {
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
  const bool is_doubtful = is_gyro_doubtful || health_.is_unusual(matched_share(alignment, features)) ||
                           (prediction && health_.is_sudden(*prediction, smoother->newest()));
  if (predicted && has_gyro && is_doubtful) {
    const bool is_turned = take_missed_turn(input, features, *predicted, &alignment, smoother);
    const Eigen::Vector3d missed = turn_between(*predicted, *smoother);
    if (is_turned || (is_gyro_doubtful && missed.norm() > kLeastMissedTurn)) {
      shock_guard_->note_missed_turn(missed);
      prediction.reset();
    }
  }
  if (alignment.is_healthy) {
    health_.add(prediction, smoother->newest(), matched_share(alignment, features));
  } else {
    health_.add_unmatched();
  }
  return alignment;
}

}  // namespace fdi_lio::odometry
