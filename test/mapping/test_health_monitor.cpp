#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/mapping/health_monitor.hpp"

namespace fdi_lio::mapping {
namespace {

imu::NavState running() {
  imu::NavState state;
  state.imu_status = imu::ImuStatus::kInitialised;
  return state;
}

TEST(HealthMonitor, FewMatchesOrASmallShareOfThemSayNothing) {
  EXPECT_FALSE(HealthMonitor::is_matched(29, 29));
  EXPECT_TRUE(HealthMonitor::is_matched(30, 100));
  EXPECT_FALSE(HealthMonitor::is_matched(90, 1000));
  EXPECT_TRUE(HealthMonitor::is_matched(100, 1000));
}

/// With a covariance that is right, the mean of 6 is a contradiction by this measure: it is made for one that
/// is cautious by a factor of five and more.
TEST(HealthMonitor, InnovationsThatStayLargeAreReported) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  std::mt19937 random(1);
  std::chi_squared_distribution<double> chi_squared(6.0);
  for (int k = 0; k < 300; ++k) monitor.add(0.1 * chi_squared(random), running());
  EXPECT_FALSE(reporter.has("imu_contradiction"));
  for (int k = 0; k < 100; ++k) monitor.add(1.5 * chi_squared(random), running());
  EXPECT_TRUE(reporter.has("imu_contradiction"));
  EXPECT_NE(reporter.take_new().front().text.find("sensor.T_imu_lidar"), std::string::npos);
}

TEST(HealthMonitor, OneLargeInnovationIsNoContradiction) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  for (int k = 0; k < 300; ++k) monitor.add(k % 60 == 0 ? 500.0 : 0.2, running());
  EXPECT_FALSE(reporter.has("imu_contradiction"));
}

TEST(HealthMonitor, ABeginningMaySettle) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  for (int beginning = 0; beginning < 3; ++beginning) {
    for (int k = 0; k < 25; ++k) monitor.add(15.0, running());
    for (int k = 0; k < 100; ++k) monitor.add(0.2, running());
    monitor.restart();
  }
  EXPECT_FALSE(reporter.has("imu_contradiction"));
}

TEST(HealthMonitor, ManyUnmatchedScansInARowAreReportedAsLost) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  for (int k = 0; k < 200; ++k) {
    if (k % 40 == 39) {
      monitor.add(0.2, running());
    } else {
      monitor.add_unmatched();
    }
  }
  EXPECT_FALSE(reporter.has("lost"));
  for (int k = 0; k < 60; ++k) monitor.add_unmatched();
  ASSERT_TRUE(reporter.has("lost"));
  EXPECT_EQ(reporter.notices().at("lost").count, 1U);
}

TEST(HealthMonitor, BiasesThatNoSensorHasAreReported) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  imu::NavState state = running();
  state.accel_bias = Eigen::Vector3d(0.5, -0.6, 0.3);
  state.gyro_bias = Eigen::Vector3d(0.03, 0.0, -0.05);
  monitor.add(0.2, state);
  EXPECT_FALSE(reporter.has("imu_bias"));
  state.accel_bias.z() = 1.2;
  state.imu_status = imu::ImuStatus::kInitialising;
  monitor.add(0.2, state);
  EXPECT_FALSE(reporter.has("imu_bias"));
  state.imu_status = imu::ImuStatus::kInitialised;
  monitor.add(0.2, state);
  EXPECT_TRUE(reporter.has("imu_bias"));
}

}  // namespace
}  // namespace fdi_lio::mapping
