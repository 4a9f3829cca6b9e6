#include <gtest/gtest.h>

#include "fdi_lio/odometry/shock_guard.hpp"

namespace fdi_lio::odometry {
namespace {

TEST(ShockGuard, DoubtsWhatNoVehicleDoes) {
  Reporter reporter;
  ShockGuard guard(10.0, &reporter);
  EXPECT_EQ(guard.add(0.0, 0.0), 0.0);
  EXPECT_EQ(guard.add(0.5, 0.1), 0.0);
  EXPECT_NEAR(guard.add(0.75, 0.1), 0.375, 1e-12);
  EXPECT_NEAR(guard.add(1.0, 0.1), 1.0, 1e-12);
  EXPECT_NEAR(guard.add(3.0, 0.1), 3.0, 1e-12);
  EXPECT_EQ(guard.add(0.5, 0.2), 0.0);
}

TEST(ShockGuard, DoubtsTheGyroForTwoScansMore) {
  Reporter reporter;
  ShockGuard guard(10.0, &reporter);
  guard.add(0.0, 0.1);
  EXPECT_FALSE(guard.is_gyro_doubtful());
  const Eigen::Vector3d turn(0.0, 0.1, 0.2);
  guard.note_missed_turn(turn);
  EXPECT_TRUE(reporter.has("gyro_missed"));
  for (int scan = 0; scan < 2; ++scan) {
    guard.add(0.0, 0.1);
    EXPECT_EQ(guard.doubtful_turn(), turn) << scan;
    EXPECT_TRUE(guard.is_gyro_doubtful()) << scan;
    EXPECT_TRUE(guard.is_shocked()) << scan;
  }
  guard.add(0.0, 0.1);
  EXPECT_FALSE(guard.is_gyro_doubtful());
  EXPECT_FALSE(guard.is_shocked());
}

TEST(ShockGuard, DoubtsTheAccelerometerForTwoScansMore) {
  Reporter reporter;
  ShockGuard guard(10.0, &reporter);
  guard.add(0.0, 0.1);
  EXPECT_FALSE(guard.is_accel_doubtful());
  guard.note_missed_step(0.1, 2.0);
  EXPECT_TRUE(reporter.has("accel_missed"));
  EXPECT_TRUE(guard.is_shocked());
  EXPECT_EQ(guard.add(0.0, 0.1), 2.0);
  EXPECT_TRUE(guard.is_accel_doubtful());
  EXPECT_FALSE(guard.is_gyro_doubtful());
  // More than that may be false by itself.
  EXPECT_EQ(guard.add(3.0, 0.1), 3.0);
  for (int scan = 0; scan < 2; ++scan) EXPECT_EQ(guard.add(0.0, 0.1), 2.0);
  EXPECT_EQ(guard.add(0.0, 0.1), 0.0);
  EXPECT_FALSE(guard.is_accel_doubtful());
}

TEST(ShockGuard, IsOnItsGuardForThreeScans) {
  Reporter reporter;
  ShockGuard guard(10.0, &reporter);
  guard.add(0.6, 0.1);  // by 1.2 cm at most
  EXPECT_FALSE(guard.is_shocked());
  EXPECT_FALSE(reporter.has("imu_shock"));
  guard.add(2.0, 0.1);
  EXPECT_TRUE(reporter.has("imu_shock"));
  for (int scan = 0; scan < 3; ++scan) {
    EXPECT_TRUE(guard.is_shocked()) << scan;
    guard.add(0.0, 0.1);
  }
  EXPECT_FALSE(guard.is_shocked());
}

}  // namespace
}  // namespace fdi_lio::odometry
