#include <cmath>

#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/localisation/place_hypothesis.hpp"

namespace fdi_lio::localisation {
namespace {

/// At x in the map, confirmed as often as needed, fitting with `fit`; the walls fit with `walls`.
PlaceHypothesis at(double x_m, double fit, double walls) {
  PlaceHypothesis hypothesis;
  hypothesis.estimate.T_map_odom.translation().x() = x_m;
  hypothesis.estimate.covariance = isotropic(0.01, 0.1);
  hypothesis.confirmations = LocalisationConfig().confirmations;
  hypothesis.fits = {4, {walls, fit}};
  hypothesis.known_sigma_m = needed_sigma_m(0.0);
  return hypothesis;
}

/// Without contrast in brightness.
PlaceHypothesis at(double x_m, double fit) { return at(x_m, fit, fit); }

/// Far enough from where the hypotheses were found.
OdometryNow later() {
  OdometryNow now;
  now.way_m = LocalisationConfig().confirm_distance_m;
  return now;
}

const PlaceHypothesis* choose(const std::vector<PlaceHypothesis>& hypotheses,
                              const std::optional<PlaceExpectation>& expectation = std::nullopt) {
  return believed(hypotheses, expectation, later(), LocalisationConfig());
}

TEST(PlaceHypothesis, FitKnowsWallsAndBrightness) {
  mapping::LoopCandidate candidate;
  candidate.wall_share = 0.8;
  candidate.surface_correlation = 1.0;  // also where there is no contrast
  EXPECT_DOUBLE_EQ(fit_of(candidate), 0.8);
  candidate.surface_correlation = 0.5;
  EXPECT_DOUBLE_EQ(fit_of(candidate), 0.4);
  candidate.surface_correlation = -0.5;
  EXPECT_DOUBLE_EQ(fit_of(candidate), 0.0);
}

TEST(PlaceHypothesis, RegistrationsThatFailCountAsNoFit) {
  mapping::LoopCandidate candidate;
  candidate.wall_share = 0.8;
  candidate.surface_correlation = 0.5;
  candidate.verdict = mapping::LoopVerdict::kAccepted;
  PlaceHypothesis hypothesis;
  hypothesis.add(candidate);
  EXPECT_DOUBLE_EQ(hypothesis.mean_walls(), 0.8);
  EXPECT_DOUBLE_EQ(hypothesis.mean_score(), 0.4);
  candidate.verdict = mapping::LoopVerdict::kFewWalls;
  hypothesis.add(candidate);
  EXPECT_EQ(hypothesis.failures, 1);
  EXPECT_DOUBLE_EQ(hypothesis.mean_walls(), 0.4);
  EXPECT_DOUBLE_EQ(hypothesis.mean_score(), 0.2);
}

/// What drives from one of two equal doors to an unlike one is to be told from the other soon.
TEST(PlaceHypothesis, OnlyTheLastRegistrationsCount) {
  mapping::LoopCandidate candidate;
  candidate.verdict = mapping::LoopVerdict::kAccepted;
  PlaceHypothesis hypothesis;
  candidate.wall_share = 0.3;
  for (int k = 0; k < 20; ++k) hypothesis.add(candidate);
  candidate.wall_share = 0.9;
  for (std::size_t k = 0; k < PlaceHypothesis::kFits; ++k) hypothesis.add(candidate);
  EXPECT_DOUBLE_EQ(hypothesis.mean_walls(), 0.9);
  hypothesis.confirmations = 2;
  hypothesis.begin_anew();
  EXPECT_EQ(hypothesis.mean_score(), 0.0);
  EXPECT_EQ(hypothesis.confirmations, 0);
}

TEST(PlaceHypothesis, TheBestIsBelievedWhenNoOtherFitsNearlyAsWell) {
  EXPECT_EQ(choose({}), nullptr);
  const std::vector<PlaceHypothesis> clear = {at(0.0, 0.6), at(5.0, 0.8)};
  EXPECT_EQ(choose(clear), &clear[1]);
  EXPECT_EQ(choose({at(0.0, 0.75), at(5.0, 0.8)}), nullptr);
}

/// Equal doors: the walls say nothing, what hangs beside them does.
TEST(PlaceHypothesis, BrightnessDecidesBetweenEqualWalls) {
  const double fit = LocalisationConfig().min_fit;
  const std::vector<PlaceHypothesis> doors = {at(0.0, 0.5 * fit, 0.9), at(3.3, fit + 0.01, 0.9)};
  EXPECT_EQ(choose(doors), &doors[1]);
  // A door that the session does not know looks a little like one of those that it knows.
  EXPECT_EQ(choose({at(0.0, 0.5 * fit, 0.9), at(3.3, fit - 0.01, 0.9)}), nullptr);
  // Where no walls are alike, brightness need not say so much.
  const std::vector<PlaceHypothesis> clear = {at(0.0, 0.2, 0.5), at(3.3, 0.4, 0.9)};
  EXPECT_EQ(choose(clear), &clear[1]);
}

TEST(PlaceHypothesis, EqualWallsAreToldApartOnTheWayOnly) {
  std::vector<PlaceHypothesis> doors = {at(0.0, 0.3, 0.9), at(3.3, 0.8, 0.9)};
  OdometryNow waiting;
  waiting.stamp = static_cast<Stamp>(1e9 * (LocalisationConfig().confirm_time_s + 1.0));
  EXPECT_EQ(believed(doors, std::nullopt, waiting, LocalisationConfig()), nullptr);
  EXPECT_EQ(believed({doors[1]}, std::nullopt, waiting, LocalisationConfig())
                ->estimate.T_map_odom.translation()
                .x(),
            3.3);
}

TEST(PlaceHypothesis, EachConditionIsNeeded) {
  PlaceHypothesis good = at(0.0, 0.8);
  EXPECT_NE(choose({good}), nullptr);
  PlaceHypothesis few = good;
  few.confirmations -= 1;
  EXPECT_EQ(choose({few}), nullptr);
  PlaceHypothesis failed = good;
  failed.failures = 1;
  EXPECT_EQ(choose({failed}), nullptr);
  PlaceHypothesis fresh = good;
  fresh.found_at_m = later().way_m - 0.5;
  EXPECT_EQ(choose({fresh}), nullptr);
  PlaceHypothesis long_ago = fresh;
  long_ago.found_at = -static_cast<Stamp>(1e9 * (LocalisationConfig().confirm_time_s + 0.1));
  EXPECT_NE(choose({long_ago}), nullptr);
  PlaceHypothesis somewhere = good;
  somewhere.estimate.covariance(3, 3) = 0.6 * 0.6;
  EXPECT_EQ(choose({somewhere}), nullptr);
  PlaceHypothesis turned = good;
  turned.estimate.covariance(2, 2) = 0.05 * 0.05;
  EXPECT_EQ(choose({turned}), nullptr);
}

/// Between near walls a registration says nothing of the roll.
TEST(PlaceHypothesis, RollNeedNotBeKnown) {
  PlaceHypothesis rolling = at(0.0, 0.8);
  rolling.estimate.covariance(0, 0) = 0.2 * 0.2;
  EXPECT_NE(choose({rolling}), nullptr);
}

TEST(PlaceHypothesis, TheUsersWordDecidesBetweenEqualsButNotAgainstABetterFit) {
  PlaceExpectation said;
  said.T_map_odom.translation().x() = 0.3;
  said.sigma_m = 0.5;
  said.is_given = true;
  std::vector<PlaceHypothesis> doors = {at(0.0, 0.8), at(3.3, 0.8)};
  EXPECT_EQ(choose(doors, said), nullptr);  // they were found by looks, not by the word
  for (PlaceHypothesis& each : doors) each.is_given = true;
  EXPECT_EQ(choose(doors, said), &doors[0]);
  // As the odometry goes on, so does what was said.
  OdometryNow now = later();
  now.T_odom_imu.translation() = Eigen::Vector3d(7.0, 1.0, 0.0);
  EXPECT_EQ(believed(doors, said, now, LocalisationConfig()), &doors[0]);
  // What was said may be off by two standard deviations where another place fits better.
  std::vector<PlaceHypothesis> near = {at(0.3, 0.6), at(1.3, 0.9)};
  for (PlaceHypothesis& each : near) each.is_given = true;
  EXPECT_EQ(choose(near, said), &near[1]);
}

TEST(PlaceHypothesis, EqualPlacesAreJoined) {
  PlaceHypothesis newer = at(0.2, 0.9);
  newer.confirmations = 0;
  std::vector<PlaceHypothesis> hypotheses = {newer, at(0.0, 0.7), at(0.1, 0.8), at(0.9, 0.5)};
  join_equal(Eigen::Isometry3d::Identity(), &hypotheses);
  ASSERT_EQ(hypotheses.size(), 2U);
  EXPECT_DOUBLE_EQ(hypotheses[0].mean_score(), 0.8);
  EXPECT_DOUBLE_EQ(hypotheses[1].mean_score(), 0.5);
}

TEST(PlaceHypothesis, LargestSigmaIsThatOfTheLongestAxis) {
  const Eigen::Matrix3d R = so3::exp(Eigen::Vector3d(0.3, -0.8, 1.1));
  const Eigen::Matrix3d covariance = R * Eigen::Vector3d(4.0, 0.25, 1.0).asDiagonal() * R.transpose();
  EXPECT_NEAR(largest_sigma(covariance), 2.0, 1e-12);
}

}  // namespace
}  // namespace fdi_lio::localisation
