#include <cmath>
#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "fdi_lio/matching/mean_radius.hpp"

namespace fdi_lio::matching {
namespace {

using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

/// Normal equations of pose and radius from residuals with random Jacobians.
struct Joint {
  Matrix7d H = Matrix7d::Zero();
  Vector7d b = Vector7d::Zero();

  Joint(unsigned seed, int residuals) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    for (int i = 0; i < residuals; ++i) {
      const Vector7d J = Vector7d::NullaryExpr([&] { return normal(generator); });
      H += J * J.transpose();
      b += J * normal(generator);
    }
  }

  LidarInformation information() const {
    LidarInformation result;
    result.H = H.topLeftCorner<6, 6>();
    result.b = b.head<6>();
    result.radius.information = H(6, 6);
    result.radius.gradient = b[6];
    result.radius.with_pose = H.block<6, 1>(0, 6);
    return result;
  }
};

TEST(MeanRadius, TakenOutThePoseIsThatOfAllSevenUnknowns) {
  const double sigma_m = 0.3;
  const Joint joint(1, 30);
  Matrix7d H = joint.H;
  H(6, 6) += 1.0 / (sigma_m * sigma_m);
  const Vector7d expected = -H.inverse() * joint.b;
  LidarInformation information = joint.information();
  MeanRadius(sigma_m).eliminate(&information);
  EXPECT_TRUE((-information.H.inverse() * information.b).isApprox(expected.head<6>(), 1e-9));
  EXPECT_TRUE(information.H.inverse().isApprox(H.inverse().topLeftCorner<6, 6>(), 1e-9));
}

TEST(MeanRadius, IsLearnedFromWhatNoPoseExplains) {
  const double sigma_m = 0.3;
  const Joint joint(2, 30);
  // Without a prior on the pose, so that only what it cannot take up counts.
  Matrix7d H = joint.H;
  H(6, 6) += 1.0 / (sigma_m * sigma_m);
  const double expected_m = (-H.inverse() * joint.b)[6];
  MeanRadius radius(sigma_m);
  LidarInformation information = joint.information();
  radius.learn(radius.eliminate(&information));
  EXPECT_NEAR(radius.mean_m(), expected_m, 1e-3 * std::abs(expected_m));
}

TEST(MeanRadius, OfAnotherPlaceIsLearnedAnew) {
  MeanRadius radius(0.1);
  const auto see = [&](double true_m, int scans) {
    for (int i = 0; i < scans; ++i) radius.learn({400.0, 400.0 * (radius.mean_m() - true_m)});
  };
  see(0.03, 1);
  EXPECT_NEAR(radius.mean_m(), 0.03 * 400.0 / 500.0, 1e-9)
      << "a prior of 0.1 m is worth a quarter of this scan";
  see(0.03, 300);
  EXPECT_NEAR(radius.mean_m(), 0.03, 1e-4);
  see(0.2, 300);
  EXPECT_NEAR(radius.mean_m(), 0.2, 0.17 * std::exp(-2.5)) << "after three times 100 scans";
}

TEST(MeanRadius, StaysZeroWithoutADeviation) {
  const Joint joint(3, 30);
  MeanRadius radius(0.0);
  LidarInformation information = joint.information();
  radius.learn(radius.eliminate(&information));
  EXPECT_EQ(radius.mean_m(), 0.0);
  EXPECT_EQ(information.H, joint.information().H);
  EXPECT_EQ(information.b, joint.information().b);
}

TEST(MeanRadius, WithoutLinesNothingChanges) {
  LidarInformation information = Joint(4, 30).information();
  information.radius = RadiusSums();
  const LidarInformation before = information;
  MeanRadius radius(0.1);
  radius.learn(radius.eliminate(&information));
  EXPECT_EQ(radius.mean_m(), 0.0);
  EXPECT_EQ(information.H, before.H);
  EXPECT_EQ(information.b, before.b);
}

TEST(MeanRadius, OfLinesThatTellNothingElseKeepsTheEquationsFinite) {
  LidarInformation information;
  information.radius.information = 100.0;
  information.radius.gradient = -2.0;
  MeanRadius radius(0.1);
  radius.learn(radius.eliminate(&information));
  EXPECT_TRUE(information.H.allFinite());
  EXPECT_NEAR(radius.mean_m(), 0.01, 1e-9);
}

}  // namespace
}  // namespace fdi_lio::matching
