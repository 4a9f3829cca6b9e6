#include <cmath>

#include "synthetic_places.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/mapping/correction_blend.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr Stamp kStart = 1700000000LL * 1000000000LL;

Stamp at(double seconds) { return add_seconds(kStart, seconds); }

TEST(CorrectionBlend, TakesTheFirstCorrectionAsItIs) {
  CorrectionBlend blend(1.0);
  const Eigen::Isometry3d T = planar_pose(3.0, 4.0, 0.5);
  EXPECT_TRUE(blend.follow(at(0.0), T, planar_pose(100.0, 0.0, 0.0)).isApprox(T, 1e-12));
}

TEST(CorrectionBlend, MakesUpForTheShareOfTheTimeConstant) {
  CorrectionBlend blend(2.0);
  const Eigen::Isometry3d T_odom_imu = planar_pose(500.0, -200.0, 1.0);
  const Eigen::Isometry3d before = planar_pose(0.0, 0.0, 0.0);
  // 1 m to the side and 0.1 rad about the robot, far from the origin.
  const Eigen::Isometry3d after = T_odom_imu * planar_pose(0.0, 1.0, 0.1) * T_odom_imu.inverse();
  blend.follow(at(0.0), before, T_odom_imu);
  double elapsed = 0.0;
  for (const double step : {0.1, 0.1, 0.5, 0.3}) {
    elapsed += step;
    const Eigen::Isometry3d T = blend.follow(at(elapsed), after, T_odom_imu);
    const Eigen::Isometry3d moved_by = T_odom_imu.inverse() * T * T_odom_imu;
    const double share = 1.0 - std::exp(-elapsed / 2.0);
    EXPECT_NEAR(moved_by.translation().norm(), share, 1e-9);
    EXPECT_NEAR(Eigen::AngleAxisd(moved_by.linear()).angle(), 0.1 * share, 1e-9);
  }
  EXPECT_TRUE(blend.follow(at(100.0), after, T_odom_imu).isApprox(after, 1e-9));
}

TEST(CorrectionBlend, FollowsAtOnceWithoutATimeConstantAndAfterReset) {
  const Eigen::Isometry3d a = planar_pose(1.0, 0.0, 0.0);
  const Eigen::Isometry3d b = planar_pose(2.0, 5.0, 1.0);
  CorrectionBlend at_once(0.0);
  at_once.follow(at(0.0), a, a);
  EXPECT_TRUE(at_once.follow(at(0.1), b, a).isApprox(b, 1e-12));
  CorrectionBlend slow(100.0);
  slow.follow(at(0.0), a, a);
  slow.reset();
  EXPECT_TRUE(slow.follow(at(0.1), b, a).isApprox(b, 1e-12));
}

}  // namespace
}  // namespace fdi_lio::mapping
