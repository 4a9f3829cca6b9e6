#include <cmath>

#include "synthetic_drive.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/mapping/odometry_check.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr double kSigmaRad = 1e-3;
constexpr double kSigmaM = 0.02;

RelativePose odometry_step() {
  RelativePose step;
  step.T_from_to = planar_pose(1.5, 0.1, 0.02);
  step.information = isotropic(kSigmaRad, kSigmaM).inverse();
  return step;
}

/// What the clouds say: `off_m` farther ahead than the odometry. Its covariance is a hundredth of the
/// odometry's, but along y, which it does not know.
RelativePose registered_step(double off_m) {
  RelativePose step = odometry_step();
  step.T_from_to.translation() += Eigen::Vector3d(off_m, off_m, 0.0);
  Matrix6d covariance = isotropic(0.1 * kSigmaRad, 0.1 * kSigmaM);
  covariance(4, 4) = 100.0;
  step.information = covariance.inverse();
  return step;
}

TEST(OdometryCheck, LooksSeldomWhileTheCloudsAgree) {
  OdometryCheck check;
  int registered = 0;
  for (int k = 0; k < 110; ++k) {
    if (!check.is_due()) continue;
    ++registered;
    EXPECT_TRUE(check.checked(odometry_step(), registered_step(0.1 * kSigmaM))
                    .T_from_to.isApprox(odometry_step().T_from_to, 1e-12));
  }
  EXPECT_EQ(registered, 15);
}

TEST(OdometryCheck, LooksAtEachStepAfterOneThatDeviates) {
  OdometryCheck check;
  for (int k = 0; k < 10; ++k) {
    ASSERT_TRUE(check.is_due());
    check.unregistered();
  }
  while (!check.is_due()) {
  }
  check.checked(odometry_step(), registered_step(4.0 * kSigmaM));
  for (int k = 0; k < 10; ++k) {
    EXPECT_TRUE(check.is_due()) << k;
    check.unregistered();
  }
  EXPECT_FALSE(check.is_due());
}

/// Outliers among agreeing steps, and the first steps, are the registration's.
TEST(OdometryCheck, BelievesTheOdometryUntilHalfOfTheStepsDeviate) {
  OdometryCheck check;
  check.checked(odometry_step(), registered_step(4.0 * kSigmaM));
  EXPECT_FALSE(check.contradicts());
  for (int k = 0; k < 10; ++k) check.checked(odometry_step(), registered_step(0.0));
  for (int k = 0; k < 5; ++k) {
    const RelativePose step = check.checked(odometry_step(), registered_step(4.0 * kSigmaM));
    EXPECT_TRUE(step.T_from_to.isApprox(odometry_step().T_from_to, 1e-12)) << k;
  }
  const RelativePose step = check.checked(odometry_step(), registered_step(4.0 * kSigmaM));
  EXPECT_NEAR(step.T_from_to.translation().x(), 1.5 + 4.0 * kSigmaM, 0.1 * kSigmaM);
}

/// Against the information filter's way to write the same: (C'^-1 + C_r^-1) d = C_r^-1 e.
TEST(OdometryCheck, WeighsBothByTheirCovariances) {
  OdometryCheck check;
  const RelativePose odometry = odometry_step();
  const RelativePose registered = registered_step(3.0 * kSigmaM);
  const Vector6d error = difference(odometry.T_from_to, registered.T_from_to);
  const Matrix6d C = odometry.information.inverse();
  const Matrix6d sum = C + registered.information.inverse();
  const double scale = std::max(1.0, error.dot(sum.inverse() * error) / 6.0);
  ASSERT_GT(scale, 1.0);
  const Matrix6d scaled_information = odometry.information / scale;
  const Matrix6d fused = (scaled_information + registered.information).inverse();
  for (int k = 0; k < 4; ++k) check.checked(odometry, registered);
  const RelativePose step = check.checked(odometry, registered);
  const Eigen::Isometry3d expected = moved(odometry.T_from_to, fused * registered.information * error);
  EXPECT_TRUE(step.T_from_to.isApprox(expected, 1e-9));
  EXPECT_TRUE(step.information.inverse().isApprox(C + fused, 1e-6));
  // What the registration does not know stays as the odometry has it.
  EXPECT_NEAR(step.T_from_to.translation().y(), odometry.T_from_to.translation().y(), 1e-3 * kSigmaM);
}

/// A lap with a steady error of heading, which no loop shows: a closed ring with such an error closes as
/// well.
TEST(OdometryCheck, GivesADisturbedLapItsShapeBack) {
  const SyntheticDrive drive(1, 1.3, 2e-3);
  Config config;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  for (const Keyframe& keyframe : drive.keyframes) global.add(keyframe);
  global.finish();
  double worst_odometry = 0.0;
  double worst = 0.0;
  for (std::size_t k = 0; k < drive.truth.size(); ++k) {
    const auto off = [&](const Eigen::Isometry3d& T, const Eigen::Isometry3d& T_first) -> Eigen::Vector3d {
      return (T_first.inverse() * T).translation() -
             (drive.truth[0].inverse() * drive.truth[k]).translation();
    };
    worst_odometry =
        std::max(worst_odometry, off(drive.keyframes[k].T_odom_imu, drive.keyframes[0].T_odom_imu).norm());
    worst = std::max(worst, off(global.T_map_imu(k), global.T_map_imu(0)).norm());
  }
  EXPECT_GT(worst_odometry, 5.0);
  EXPECT_LT(worst, 1.0);
}

}  // namespace
}  // namespace fdi_lio::mapping
