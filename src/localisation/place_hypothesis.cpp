#include "fdi_lio/localisation/place_hypothesis.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::localisation {

namespace {

constexpr double kDegree = M_PI / 180.0;
/// Estimates that are nearer to each other are the same place.
constexpr double kSamePlaceM = 0.5;
constexpr double kSamePlaceRad = 5.0 * kDegree;
/// A place is believed when it is known to this standard deviation,
constexpr double kKnownSigmaM = 0.5;
constexpr double kKnownSigmaRad = 2.0 * kDegree;
/// or, where a pose was expected, to so many of its own.
constexpr double kExpectedSigmas = 1.5;
/// What the user said decides between places that fit alike. Fits differ by a fifth where it matters, so it
/// is taken with so many of its standard deviations to leave the word to a place that fits better.
constexpr double kPriorSigmas = 4.0;

bool is_same_place(const PlaceEstimate& a, const PlaceEstimate& b, const Eigen::Isometry3d& T_odom_imu) {
  const Vector6d apart = difference(a.T_map_odom * T_odom_imu, b.T_map_odom * T_odom_imu);
  return apart.tail<3>().norm() < kSamePlaceM && apart.head<3>().norm() < kSamePlaceRad;
}

double mean_of(const std::deque<PlaceFit>& fits, double PlaceFit::*figure) {
  double sum = 0.0;
  for (const PlaceFit& fit : fits) sum += fit.*figure;
  return fits.empty() ? 0.0 : sum / static_cast<double>(fits.size());
}

/// Whether enough registrations agree and every direction is known.
bool is_known(const PlaceHypothesis& hypothesis, const OdometryNow& now, const LocalisationConfig& config) {
  if (hypothesis.confirmations < config.confirmations || hypothesis.failures > 0) return false;
  const Matrix6d& covariance = hypothesis.estimate.covariance;
  // Between near walls a registration says little of the roll; gravity does.
  const Eigen::Vector3d up_imu = (hypothesis.estimate.T_map_odom * now.T_odom_imu).linear().row(2);
  const double heading_sigma = std::sqrt(up_imu.dot(covariance.topLeftCorner<3, 3>() * up_imu));
  return largest_sigma(covariance.bottomRightCorner<3, 3>()) < hypothesis.known_sigma_m &&
         heading_sigma < kKnownSigmaRad;
}

}  // namespace

double fit_of(const mapping::LoopCandidate& candidate) {
  return candidate.wall_share * std::max(0.0, candidate.surface_correlation);
}

double PlaceHypothesis::mean_walls() const { return mean_of(fits, &PlaceFit::walls); }
double PlaceHypothesis::mean_score() const { return mean_of(fits, &PlaceFit::score); }

void PlaceHypothesis::begin_anew() {
  confirmations = 0;
  fits.clear();
}

void PlaceHypothesis::add(const mapping::LoopCandidate& candidate) {
  const bool is_good = candidate.verdict == mapping::LoopVerdict::kAccepted;
  failures = is_good ? 0 : failures + 1;
  fits.push_back(is_good ? PlaceFit{candidate.wall_share, fit_of(candidate)} : PlaceFit{});
  if (fits.size() > kFits) fits.pop_front();
}

double largest_sigma(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[2]));
}

double needed_sigma_m(double expected_sigma_m) {
  return std::max(kKnownSigmaM, kExpectedSigmas * expected_sigma_m);
}

double belief(const PlaceHypothesis& hypothesis, const std::optional<PlaceExpectation>& expectation,
              const Eigen::Isometry3d& T_odom_imu) {
  if (!hypothesis.is_given || !expectation) return hypothesis.mean_score();
  const Eigen::Vector3d apart = (hypothesis.estimate.T_map_odom * T_odom_imu).translation() -
                                (expectation->T_map_odom * T_odom_imu).translation();
  const double sigmas = apart.head<2>().norm() / (kPriorSigmas * expectation->sigma_m);
  return hypothesis.mean_score() * std::exp(-0.5 * sigmas * sigmas);
}

void join_equal(const Eigen::Isometry3d& T_odom_imu, std::vector<PlaceHypothesis>* hypotheses) {
  std::stable_sort(hypotheses->begin(), hypotheses->end(),
                   [](const PlaceHypothesis& a, const PlaceHypothesis& b) {
                     if (a.confirmations != b.confirmations) return a.confirmations > b.confirmations;
                     return a.mean_score() > b.mean_score();
                   });
  std::vector<PlaceHypothesis> kept;
  for (const PlaceHypothesis& each : *hypotheses) {
    const bool is_known = std::any_of(kept.begin(), kept.end(), [&](const PlaceHypothesis& other) {
      return is_same_place(other.estimate, each.estimate, T_odom_imu);
    });
    if (!is_known) kept.push_back(each);
  }
  *hypotheses = kept;
}

const PlaceHypothesis* believed(const std::vector<PlaceHypothesis>& hypotheses,
                                const std::optional<PlaceExpectation>& expectation, const OdometryNow& now,
                                const LocalisationConfig& config) {
  const auto belief_of = [&](const PlaceHypothesis& each) {
    return belief(each, expectation, now.T_odom_imu);
  };
  const auto best = std::max_element(
      hypotheses.begin(), hypotheses.end(),
      [&](const PlaceHypothesis& a, const PlaceHypothesis& b) { return belief_of(a) < belief_of(b); });
  if (best == hypotheses.end() || !is_known(*best, now, config)) return nullptr;
  const auto has_other = [&](const auto& is_alike) {
    return std::any_of(hypotheses.begin(), hypotheses.end(),
                       [&](const PlaceHypothesis& other) { return &other != &*best && is_alike(other); });
  };
  if (has_other([&](const PlaceHypothesis& other) {
        return belief_of(other) > config.ambiguity * belief_of(*best);
      }))
    return nullptr;
  const bool is_repeated = has_other([&](const PlaceHypothesis& other) {
    return other.mean_walls() > config.ambiguity * best->mean_walls();
  });
  const bool has_moved = now.way_m - best->found_at_m >= config.confirm_distance_m;
  const bool has_waited = seconds_between(best->found_at, now.stamp) >= config.confirm_time_s;
  // Who stands still sees the same again, and what looks alike goes on to look alike.
  const bool is_sure = is_repeated && !best->is_given ? has_moved && best->mean_score() >= config.min_fit
                                                      : has_moved || has_waited;
  return is_sure ? &*best : nullptr;
}

}  // namespace fdi_lio::localisation
