#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/external_odometry.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr Stamp kSecond = 1000000000LL;

Eigen::Isometry3d pose_of(const Eigen::Vector3d& rotation, const Eigen::Vector3d& translation) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3::exp(rotation);
  T.translation() = translation;
  return T;
}

/// Even motion in `child`: `rate` turns and metres a second, a pose every 0.1 s.
ExternalOdometry even_motion(const ExternalOdometryConfig& config, double seconds) {
  ExternalOdometry odometry(config);
  for (int k = 0; k <= static_cast<int>(10.0 * seconds + 0.5); ++k) {
    ExternalPose pose;
    pose.stamp = k * kSecond / 10;
    pose.T_world_child = pose_of({0.0, 0.0, 0.02 * k}, {0.1 * k, -0.03 * k, 0.0});
    odometry.add(pose);
  }
  return odometry;
}

ExternalOdometryConfig mounted(const Eigen::Isometry3d& T_imu_child) {
  ExternalOdometryConfig config;
  config.t_imu_child = T_imu_child.translation();
  config.q_imu_child = Eigen::Quaterniond(T_imu_child.linear());
  return config;
}

TEST(ExternalOdometry, StepsAreThoseOfTheImu) {
  const Eigen::Isometry3d T_imu_child = pose_of({0.1, -0.2, 1.0}, {0.5, -0.3, 1.2});
  const ExternalOdometry odometry = even_motion(mounted(T_imu_child), 3.0);
  const auto step = odometry.step(kSecond / 2, 2 * kSecond);
  ASSERT_TRUE(step);
  const Eigen::Isometry3d T_child =
      pose_of({0.0, 0.0, 0.1}, {0.5, -0.15, 0.0}).inverse() * pose_of({0.0, 0.0, 0.4}, {2.0, -0.6, 0.0});
  EXPECT_TRUE(step->measured.T_from_to.isApprox(T_imu_child * T_child * T_imu_child.inverse(), 1e-9));
  // With a way that is twice as long in the child's frame.
  Eigen::Isometry3d T_longer = T_child;
  T_longer.translation() *= 2.0;
  const Eigen::Isometry3d T_imu_longer = T_imu_child * T_longer * T_imu_child.inverse();
  EXPECT_TRUE(
      (step->measured.T_from_to.translation() + step->way).isApprox(T_imu_longer.translation(), 1e-9));
}

TEST(ExternalOdometry, InterpolatesBetweenMessages) {
  const ExternalOdometry odometry = even_motion(ExternalOdometryConfig(), 2.0);
  const auto step = odometry.step(0, kSecond + kSecond / 20);
  ASSERT_TRUE(step);
  EXPECT_NEAR(step->measured.T_from_to.translation().x(), 1.05, 1e-9);
  EXPECT_NEAR(so3::log(Eigen::Matrix3d(step->measured.T_from_to.linear())).z(), 0.21, 1e-9);
}

/// The covariance of the IMU's step against a sample of what the errors of the child's step do to it.
TEST(ExternalOdometry, CovarianceFollowsTheMounting) {
  const Eigen::Isometry3d X = pose_of({0.1, -0.2, 1.0}, {0.5, -0.3, 1.2});
  const ExternalOdometry odometry = even_motion(mounted(X), 1.0);
  const auto step = odometry.step(0, kSecond);
  ASSERT_TRUE(step);
  const Eigen::Isometry3d T_child = X.inverse() * step->measured.T_from_to * X;
  const double way_m = T_child.translation().norm();
  const double degree = M_PI / 180.0;
  Vector6d sigma;
  sigma.head<3>().setConstant(0.2 * degree * way_m + 0.1 * 0.2 + 0.1 * degree);
  sigma.tail<3>().setConstant(0.02 * way_m + 0.005);
  Matrix6d expected = Matrix6d::Zero();
  for (int k = 0; k < 6; ++k) {
    Vector6d delta = Vector6d::Zero();
    delta[k] = 1e-5;
    const Vector6d effect =
        difference(step->measured.T_from_to, X * moved(T_child, delta) * X.inverse()) / 1e-5 * sigma[k];
    expected += effect * effect.transpose();
  }
  EXPECT_TRUE(step->measured.information.inverse().isApprox(expected, 1e-4));
}

TEST(ExternalOdometry, UnknownAxesSayNothing) {
  ExternalOdometry odometry{ExternalOdometryConfig()};
  for (int k = 0; k < 11; ++k) {
    ExternalPose pose;
    pose.stamp = k * kSecond / 10;
    pose.T_world_child.translation().x() = 0.1 * k;
    pose.pose_variance[5] = 1e6;
    pose.twist_variance[0] = 99999.0;
    pose.twist_variance[3] = 0.04;
    odometry.add(pose);
  }
  const auto step = odometry.step(0, kSecond);
  ASSERT_TRUE(step);
  const Vector6d information = step->measured.information.diagonal();
  EXPECT_LT(information[5], 1e-5);
  EXPECT_LT(information[0], 1e-5);
  EXPECT_NEAR(1.0 / information[3], 0.04 + std::pow(0.02 * 1.0 + 0.005, 2), 1e-6);
  EXPECT_GT(information[4], 1e3);
}

TEST(ExternalOdometry, NothingAcrossAGapOrBeforeTheBeginning) {
  ExternalOdometry odometry = even_motion(ExternalOdometryConfig(), 1.0);
  ExternalPose late;
  late.stamp = 3 * kSecond;
  ASSERT_TRUE(odometry.add(late));
  EXPECT_FALSE(odometry.step(kSecond / 2, 2 * kSecond));
  EXPECT_FALSE(odometry.step(-kSecond, kSecond / 2));
  EXPECT_FALSE(odometry.step(0, 4 * kSecond));
  // A stamp that was measured needs no neighbour.
  EXPECT_TRUE(odometry.step(kSecond, 3 * kSecond));
  EXPECT_TRUE(odometry.reaches(3 * kSecond));
  EXPECT_FALSE(odometry.reaches(3 * kSecond + 1));
}

TEST(ExternalOdometry, RefusesWhatIsNoPose) {
  ExternalOdometry odometry = even_motion(ExternalOdometryConfig(), 1.0);
  const std::size_t before = odometry.size();
  ExternalPose pose;
  pose.stamp = 2 * kSecond;
  pose.T_world_child.linear().setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(odometry.add(pose));
  pose.T_world_child.linear() = -Eigen::Matrix3d::Identity();
  EXPECT_FALSE(odometry.add(pose));
  pose = ExternalPose();
  pose.stamp = 2 * kSecond;
  pose.T_world_child.translation().y() = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(odometry.add(pose));
  pose = ExternalPose();
  pose.stamp = kSecond;  // repeated
  EXPECT_FALSE(odometry.add(pose));
  EXPECT_EQ(odometry.size(), before);
}

TEST(ExternalOdometry, ForgetsWhatNoLaterStepNeeds) {
  ExternalOdometry odometry = even_motion(ExternalOdometryConfig(), 2.0);
  const auto before = odometry.step(kSecond + 1, 2 * kSecond);
  odometry.forget_before(kSecond + 1);
  EXPECT_EQ(odometry.size(), 11U);
  const auto after = odometry.step(kSecond + 1, 2 * kSecond);
  ASSERT_TRUE(before && after);
  EXPECT_TRUE(before->measured.T_from_to.isApprox(after->measured.T_from_to, 1e-15));
}

}  // namespace
}  // namespace fdi_lio::mapping
