#include <cmath>
#include <memory>
#include <vector>

#include "synthetic_places.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/mapping/loop_verifier.hpp"

namespace fdi_lio::mapping {
namespace {

std::vector<PlacedCloud> submap(const SyntheticWorld& world, const Eigen::Isometry3d& T_world_center) {
  std::vector<PlacedCloud> placed;
  for (int k = -2; k <= 2; ++k) {
    const Eigen::Isometry3d T_center_imu = planar_pose(2.0 * k, 0.0, 0.0);
    placed.push_back({std::make_shared<const KeyframeCloud>(
                          world.seen_from(T_world_center * T_center_imu, static_cast<unsigned>(10 + k))),
                      T_center_imu});
  }
  return placed;
}

std::vector<PlacedCloud> scan(const SyntheticWorld& world, const Eigen::Isometry3d& T_world_imu) {
  return {{std::make_shared<const KeyframeCloud>(world.seen_from(T_world_imu, 99)),
           Eigen::Isometry3d::Identity()}};
}

/// The newest keyframe with those before it, as the optimiser gives them.
std::vector<PlacedCloud> last_scans(const SyntheticWorld& world, const Eigen::Isometry3d& T_world_imu) {
  std::vector<PlacedCloud> placed;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Isometry3d T_newest_imu = planar_pose(-1.2 * k, 0.0, 0.0);
    placed.push_back({std::make_shared<const KeyframeCloud>(
                          world.seen_from(T_world_imu * T_newest_imu, static_cast<unsigned>(99 + k))),
                      T_newest_imu});
  }
  return placed;
}

RegistrationStart start_at(const Eigen::Isometry3d& T, double sigma_m) {
  RegistrationStart start;
  start.T_from_to = T;
  start.sigma_translation_m = sigma_m;
  start.sigma_rotation_rad = 0.05;
  return start;
}

double sigma_along(const LoopCandidate& candidate, const Eigen::Vector3d& axis) {
  return std::sqrt(axis.dot(candidate.covariance.bottomRightCorner<3, 3>() * axis));
}

class LoopVerifierHeadings : public testing::TestWithParam<double> {};

TEST_P(LoopVerifierHeadings, FindsThePoseFromAStartThatIsMetresOff) {
  const SyntheticWorld town = make_town(1);
  const Eigen::Isometry3d T_from = planar_pose(25.0, 0.0, 1.5);
  const Eigen::Isometry3d T_from_to = planar_pose(1.0, -1.5, GetParam());
  const LoopVerifier verifier{Config()};
  const LoopCandidate candidate = verifier.verify(submap(town, T_from), scan(town, T_from * T_from_to),
                                                  start_at(T_from_to * planar_pose(3.0, 2.0, 0.08), 3.0));
  EXPECT_EQ(candidate.verdict, LoopVerdict::kPending) << to_text(candidate.verdict);
  EXPECT_LT((candidate.measured.T_from_to.translation() - T_from_to.translation()).norm(), 0.05);
  EXPECT_LT(so3::log(Eigen::Matrix3d(T_from_to.linear().transpose() * candidate.measured.T_from_to.linear()))
                .norm(),
            0.005);
  EXPECT_EQ(candidate.weak_directions, 0);
  EXPECT_GT(candidate.intensity_correlation, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Headings, LoopVerifierHeadings, testing::Values(0.0, 1.0, M_PI, -2.0));

TEST(LoopVerifier, RejectsOtherPlaces) {
  const LoopVerifier verifier{Config()};
  const Eigen::Isometry3d T = planar_pose(25.0, 0.0, 1.5);
  const SyntheticWorld town = make_town(1);
  for (unsigned other = 2; other < 8; ++other) {
    const LoopCandidate candidate =
        verifier.verify(submap(town, T), scan(make_town(other), T), start_at(planar_pose(0, 0, 0), 3.0));
    EXPECT_NE(candidate.verdict, LoopVerdict::kPending) << other;
  }
}

/// A straight hall without end walls; with `spacing_m`, pillars that are all alike.
SyntheticWorld make_hall(double spacing_m) {
  SyntheticWorld hall;
  hall.add({-100.0, -3.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 6.0, 0.0}, 10.0);
  hall.add({-100.0, -3.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 0.0, 4.0}, 50.0);
  hall.add({-100.0, 3.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 0.0, 4.0}, 50.0);
  if (spacing_m <= 0.0) return hall;
  for (double x = -99.0; x < 99.0; x += spacing_m) {
    hall.add_box(x, -3.0, 1.0, 0.8, 4.0, 50.0, 20.0);
    hall.add_box(x, 2.2, 1.0, 0.8, 4.0, 50.0, 20.0);
  }
  return hall;
}

TEST(LoopVerifier, SmoothHallSaysNothingAlongItself) {
  const SyntheticWorld hall = make_hall(0.0);
  const LoopVerifier verifier{Config()};
  const Eigen::Isometry3d T = planar_pose(0.0, 0.0, 0.0);
  const LoopCandidate candidate =
      verifier.verify(submap(hall, T), scan(hall, planar_pose(0.7, 0.3, 0.0)), start_at(T, 1.0));
  EXPECT_GT(sigma_along(candidate, Eigen::Vector3d::UnitX()), 10.0);
  EXPECT_LT(sigma_along(candidate, Eigen::Vector3d::UnitY()), 0.1);
  EXPECT_NEAR(candidate.measured.T_from_to.translation().y(), 0.3, 0.03);
}

TEST(LoopVerifier, RepetitionWithinTheUncertaintySaysNothingAlongItself) {
  const SyntheticWorld hall = make_hall(3.0);
  const LoopVerifier verifier{Config()};
  const Eigen::Isometry3d T = planar_pose(0.0, 0.0, 0.0);
  const auto verify = [&](double sigma_m) {
    return verifier.verify(submap(hall, T), last_scans(hall, planar_pose(0.2, 0.1, 0.0)),
                           start_at(T, sigma_m));
  };
  EXPECT_GT(sigma_along(verify(1.5), Eigen::Vector3d::UnitX()), 10.0);
  // When the prediction is much better than the spacing there is only one place.
  const LoopCandidate known = verify(0.1);
  EXPECT_LT(sigma_along(known, Eigen::Vector3d::UnitX()), 0.1);
  EXPECT_NEAR(known.measured.T_from_to.translation().x(), 0.2, 0.05);
}

/// A prediction that is off by as much as a pillar is thick lies in a hollow of its own: the one side of each
/// pillar on the other.
TEST(LoopVerifier, LooksBesideThePrediction) {
  const SyntheticWorld hall = make_hall(7.0);
  const LoopVerifier verifier{Config()};
  const Eigen::Isometry3d T = planar_pose(0.0, 0.0, 0.0);
  for (const double off_m : {-1.0, 1.0}) {
    const LoopCandidate found = verifier.verify(submap(hall, T), last_scans(hall, planar_pose(0.2, 0.1, 0.0)),
                                                start_at(planar_pose(0.2 + off_m, 0.1, 0.0), 0.5));
    EXPECT_NEAR(found.measured.T_from_to.translation().x(), 0.2, 0.05) << off_m;
  }
}

TEST(LoopVerifier, StepsAreRegisteredToMillimetres) {
  const SyntheticWorld town = make_town(1);
  const Eigen::Isometry3d T = planar_pose(25.0, 0.0, 1.5);
  const Eigen::Isometry3d T_step = planar_pose(2.0, 0.0, 0.05);
  const LoopVerifier verifier{Config()};
  const auto found =
      verifier.register_step(submap(town, T), scan(town, T * T_step), T_step * planar_pose(0.3, -0.2, 0.01));
  ASSERT_TRUE(found.has_value());
  const Vector6d error = difference(T_step, found->T_from_to);
  EXPECT_LT(error.tail<3>().norm(), 0.01);
  EXPECT_LT(error.head<3>().norm(), 1e-3);
  EXPECT_FALSE(verifier.register_step(submap(make_town(2), T), scan(town, T * T_step), T_step).has_value());
}

TEST(LoopVerifier, NoPointsAreNoLoop) {
  const LoopVerifier verifier{Config()};
  const std::vector<PlacedCloud> nothing = {
      {std::make_shared<const KeyframeCloud>(), Eigen::Isometry3d::Identity()}};
  const LoopCandidate candidate =
      verifier.verify(nothing, nothing, start_at(Eigen::Isometry3d::Identity(), 1.0));
  EXPECT_EQ(candidate.verdict, LoopVerdict::kLowOverlap);
}

}  // namespace
}  // namespace fdi_lio::mapping
