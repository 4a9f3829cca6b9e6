#include <limits>

#include "synthetic_scan.hpp"
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/degeneracy/sub_factors.hpp"

namespace fdi_lio::degeneracy {
namespace {

Degeneracy first_estimate(const DeskewedScan& scan) {
  return DegeneracyEstimator(Config{}, nullptr).estimate(scan, {});
}

void expect_in_range(const Degeneracy& d) {
  EXPECT_GE(d.fdi, 0.0);
  EXPECT_LE(d.fdi, 1.0);
  EXPECT_NEAR(d.weights[0] + d.weights[1] + d.weights[2], 1.0, 1e-12);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_GT(d.weights[k], 0.0);
    EXPECT_GE(d.sub_factors[k], 0.0);
    EXPECT_LE(d.sub_factors[k], 1.0);
  }
  EXPECT_TRUE(std::isfinite(d.metrics.geometric_complexity));
  EXPECT_TRUE(std::isfinite(d.metrics.curvature_complexity));
  EXPECT_TRUE(std::isfinite(d.metrics.point_entropy));
  EXPECT_TRUE(std::isfinite(d.metrics.plane_deviation_m));
}

/// `count` equal points in two rings.
DeskewedScan equal_points(std::uint32_t count) {
  DeskewedScan scan;
  scan.points.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    scan.points[i].position = Eigen::Vector3f(3.0F, 1.0F, 0.2F);
    scan.points[i].ring = i < count / 2 ? 0 : 1;
  }
  scan.ring_begin = {0, count / 2, count};
  return scan;
}

TEST(SubFactors, GrowWithTheirCauses) {
  const DegeneracyConfig config;
  Metrics low;
  low.geometric_complexity = 0.9;
  low.point_entropy = 0.95;
  low.plane_deviation_m = 0.01;
  Metrics flat = low;
  flat.geometric_complexity = 0.2;
  Metrics rough = low;
  rough.plane_deviation_m = 0.3;
  Metrics bunched = low;
  bunched.point_entropy = 0.5;
  Metrics restless = low;
  restless.curvature_complexity = 3.0;
  EXPECT_GT(structural_sub_factor(flat, config), structural_sub_factor(low, config) + 0.5);
  EXPECT_GT(structural_sub_factor(rough, config), structural_sub_factor(low, config) + 0.5);
  EXPECT_GT(sparse_sub_factor(bunched, config), sparse_sub_factor(low, config) + 0.5);
  EXPECT_GT(dynamic_sub_factor(restless, config), dynamic_sub_factor(low, config) + 0.1);
}

TEST(SubFactors, WithoutAGradientEqualThoseOfANeutralGradient) {
  const DegeneracyConfig config;
  Metrics without;
  without.point_entropy = 0.75;
  without.curvature_complexity = 1.0;
  without.gradient_mean = 0.9;       // must not count
  without.gradient_variation = 9.0;  // must not count
  Metrics neutral = without;
  neutral.has_gradient = true;
  neutral.gradient_mean = config.gradient_centre;
  neutral.gradient_variation = config.gradient_variation_centre;
  EXPECT_DOUBLE_EQ(sparse_sub_factor(without, config), sparse_sub_factor(neutral, config));
  EXPECT_DOUBLE_EQ(dynamic_sub_factor(without, config), dynamic_sub_factor(neutral, config));
}

TEST(SubFactors, HaveTheClosedFormOfTheUncertaintyOfThePosition) {
  DegeneracyConfig config;
  config.complexity_gain = config.deviation_gain = 0.0;  // each logistic is 1/2
  config.entropy_gain = config.gradient_gain = 0.0;
  config.uncertainty_structural_gain = 2.0;
  config.uncertainty_sparse_gain = 3.0;
  config.uncertainty_centre_m = 0.01;
  Metrics metrics;
  metrics.position_sigma_m = 0.02;  // s(g ln 2) = 2^g / (1 + 2^g)
  EXPECT_NEAR(structural_sub_factor(metrics, config), 1.0 - 0.25 * (1.0 - 4.0 / 5.0), 1e-12);
  EXPECT_NEAR(sparse_sub_factor(metrics, config), 8.0 / 9.0, 1e-12);
  metrics.position_sigma_m = 0.0;  // unknown
  EXPECT_NEAR(structural_sub_factor(metrics, config), 0.75, 1e-12);
  EXPECT_NEAR(sparse_sub_factor(metrics, config), 0.5, 1e-12);
}

TEST(SubFactors, GrowWithTheShareOfMovingPointsWhereItIsKnown) {
  DegeneracyConfig config;
  config.curvature_gain = config.gradient_variation_gain = 0.0;
  config.moving_gain = 2.0;
  config.moving_centre = 0.1;
  Metrics metrics;
  metrics.moving_share = 0.299;
  EXPECT_NEAR(dynamic_sub_factor(metrics, config), 0.5, 1e-12);
  metrics.has_moving_share = true;
  EXPECT_NEAR(dynamic_sub_factor(metrics, config), 9.0 / 10.0, 1e-12);  // 3^2 / (1 + 3^2)
  metrics.moving_share = 0.0;
  EXPECT_LT(dynamic_sub_factor(metrics, config), 1e-3);
}

TEST(WeakestPositionSigma, IsTheLongestAxisOfThePositionsEllipsoid) {
  Eigen::Matrix<double, 6, 6> covariance = 100.0 * Eigen::Matrix<double, 6, 6>::Identity();
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, 3.0).normalized()).matrix();
  covariance.bottomRightCorner<3, 3>() = R * Eigen::Vector3d(1e-4, 25e-4, 4e-4).asDiagonal() * R.transpose();
  EXPECT_NEAR(weakest_position_sigma_m(covariance), 0.05, 1e-12);
  covariance(4, 4) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(weakest_position_sigma_m(covariance), 0.0);
}

TEST(DegeneracyEstimator, KnowsTheShareOfMovingPointsOnlyWhereFreeSpaceWasLookedAt) {
  DeskewedScan scan = test::cast(test::BoxRoom{});
  scan.removed.assign(scan.points.begin(), scan.points.begin() + 1000);
  scan.removal_reasons.assign(600, RemovalReason::kFreeSpace);
  scan.removal_reasons.resize(1000, RemovalReason::kIsolated);  // dust says nothing of movement
  scan.points.erase(scan.points.begin(), scan.points.begin() + 1000);
  scan.ring_begin = {0, static_cast<std::uint32_t>(scan.points.size())};
  const double share = 600.0 / static_cast<double>(scan.points.size() + 1000);
  Config config;
  config.dynamic.mode = "full";
  const Metrics full = DegeneracyEstimator(config, nullptr).estimate(scan, {}).metrics;
  EXPECT_TRUE(full.has_moving_share);
  EXPECT_DOUBLE_EQ(full.moving_share, share);
  for (const char* mode : {"plain", "off"}) {
    config.dynamic.mode = mode;
    EXPECT_FALSE(DegeneracyEstimator(config, nullptr).estimate(scan, {}).metrics.has_moving_share);
  }
}

TEST(DegeneracyEstimator, TakesTheUncertaintyOfThePositionFromMapping) {
  const DeskewedScan scan = test::cast(test::BoxRoom{});
  OptimisationStatus status;
  status.position_sigma_m = 0.5;
  const Degeneracy without = DegeneracyEstimator(Config{}, nullptr).estimate(scan, {});
  const Degeneracy with = DegeneracyEstimator(Config{}, nullptr).estimate(scan, status);
  EXPECT_EQ(without.metrics.position_sigma_m, 0.0);
  EXPECT_EQ(with.metrics.position_sigma_m, 0.5);
  EXPECT_GT(with.fdi, without.fdi + 0.3);
  status.position_sigma_m = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(DegeneracyEstimator(Config{}, nullptr).estimate(scan, status).fdi, without.fdi);
}

TEST(DegeneracyEstimator, IsFiniteAndPessimisticForScansWithoutContent) {
  const Degeneracy empty = first_estimate({});
  expect_in_range(empty);
  EXPECT_GT(empty.sub_factors[kStructural], 0.9);
  EXPECT_GT(empty.sub_factors[kSparseness], 0.9);
  EXPECT_EQ(empty.environment, EnvironmentClass::kSparse);
  for (const std::uint32_t count : {1U, 2U, 100U, 1000U}) {
    const Degeneracy d = first_estimate(equal_points(count));
    expect_in_range(d);
    EXPECT_EQ(d.environment, EnvironmentClass::kSparse);
  }
}

TEST(DegeneracyEstimator, SurvivesBadNumbers) {
  DeskewedScan scan = test::cast(test::BoxRoom{});
  scan.intensity_gradient.assign(scan.points.size(), 0.1F);
  for (std::size_t i = 0; i < scan.points.size(); i += 3) {
    scan.points[i].position.x() = std::numeric_limits<float>::quiet_NaN();
    scan.points[i].intensity = std::numeric_limits<float>::infinity();
    scan.intensity_gradient[i / 2] = std::numeric_limits<float>::quiet_NaN();
  }
  scan.points[1].position = Eigen::Vector3f::Zero();
  scan.points[2].position.setConstant(1e30F);
  expect_in_range(first_estimate(scan));
  scan.intensity_gradient.pop_back();
  scan.ring_begin.back() += 1000;  // beyond the points
  Reporter reporter;
  const Degeneracy d = DegeneracyEstimator(Config{}, &reporter).estimate(scan, {});
  expect_in_range(d);
  EXPECT_FALSE(d.metrics.has_gradient);
  EXPECT_EQ(reporter.notices().count("degeneracy.gradient_size"), 1U);
}

TEST(DegeneracyEstimator, TellsRoomPlaneAndRandomPointsApart) {
  for (const int rings : {16, 64}) {
    test::Beams beams;
    beams.rings = rings;
    if (rings == 16) beams.elevation_min_deg = -15.0;
    const Degeneracy room = first_estimate(test::cast(test::BoxRoom{}, beams));
    const Degeneracy plane = first_estimate(test::cast(test::EmptyPlane{}, beams));
    const Degeneracy random = first_estimate(test::random_points(beams));
    EXPECT_EQ(room.environment, EnvironmentClass::kStructured);
    EXPECT_EQ(plane.environment, EnvironmentClass::kSparse);
    EXPECT_LT(plane.metrics.geometric_complexity, 0.3);
    EXPECT_GT(room.metrics.geometric_complexity, 0.7);
    EXPECT_GT(random.metrics.plane_deviation_m, 3.0 * room.metrics.plane_deviation_m);
    EXPECT_LT(room.fdi, 0.2);
    EXPECT_GT(plane.fdi, room.fdi + 0.2);
    EXPECT_GT(random.fdi, room.fdi + 0.2);
  }
}

TEST(DegeneracyEstimator, GivesTheSameBitsAgainAndAfterReset) {
  const DeskewedScan scan = test::cast(test::BoxRoom{});
  DegeneracyEstimator estimator(Config{}, nullptr);
  const Degeneracy first = estimator.estimate(scan, {});
  DeskewedScan other = test::cast(test::EmptyPlane{});
  other.stamp = 2;
  estimator.estimate(other, {});
  estimator.reset();
  const Degeneracy again = estimator.estimate(scan, {});
  EXPECT_EQ(first.fdi, again.fdi);
  EXPECT_EQ(first.weights, again.weights);
  EXPECT_EQ(first.sub_factors, again.sub_factors);
  EXPECT_EQ(first.environment, again.environment);
}

TEST(DegeneracyEstimator, DoesNotCountARepeatedOrLateScan) {
  Reporter reporter;
  DegeneracyEstimator estimator(Config{}, &reporter);
  DeskewedScan scan = test::cast(test::EmptyPlane{});
  scan.stamp = 10;
  const Degeneracy first = estimator.estimate(scan, {});
  const Degeneracy repeated = estimator.estimate(scan, {});
  scan.stamp = 5;
  const Degeneracy late = estimator.estimate(scan, {});
  EXPECT_EQ(first.weights, repeated.weights);
  EXPECT_EQ(first.weights, late.weights);
  EXPECT_EQ(late.stamp, 5);
  EXPECT_EQ(reporter.notices().at("degeneracy.stale_scan").count, 2U);
}

TEST(DegeneracyEstimator, PassesOnDirectionsThatAreFinite) {
  Reporter reporter;
  DegeneracyEstimator estimator(Config{}, &reporter);
  OptimisationStatus status;
  status.localizability << 1.0, 1.0, 1.0, 1.0, 0.5, 1.2;
  const Degeneracy d = estimator.estimate({}, status);
  EXPECT_DOUBLE_EQ(d.localizability[4], 0.5);
  EXPECT_DOUBLE_EQ(d.localizability[5], 1.0);
  status.axes(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(estimator.estimate({}, status).axes.isIdentity());
  EXPECT_EQ(reporter.notices().count("degeneracy.status_not_finite"), 1U);
}

}  // namespace
}  // namespace fdi_lio::degeneracy
