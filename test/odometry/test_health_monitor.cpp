#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/odometry/health_monitor.hpp"

namespace fdi_lio::odometry {
namespace {

imu::NavState running() {
  imu::NavState state;
  state.imu_status = imu::ImuStatus::kInitialised;
  return state;
}

/// Scans of which the map knows `share`.
void add_matched(double share, int count, HealthMonitor* monitor) {
  for (int k = 0; k < count; ++k) monitor->add(std::nullopt, running(), share);
}

TEST(HealthMonitor, FewMatchesOrASmallShareOfThemSayNothing) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  add_matched(0.7, 20, &monitor);
  EXPECT_EQ(monitor.least_matches(29), 30U);
  EXPECT_EQ(monitor.least_matches(100), 30U);
  EXPECT_EQ(monitor.least_matches(1000), 100U);
}

// Few beams on open ground: the first map knows a twentieth of the scans, and more as the sensor drives.
TEST(HealthMonitor, WhereTheMapKnowsLittleASmallShareIsEnough) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  EXPECT_EQ(monitor.least_matches(2000), 30U);
  add_matched(0.05, 30, &monitor);
  EXPECT_NEAR(static_cast<double>(monitor.least_matches(2000)), 0.4 * 0.05 * 2000, 1.0);
  add_matched(0.5, 60, &monitor);
  EXPECT_EQ(monitor.least_matches(2000), 200U);
  monitor.restart();
  EXPECT_EQ(monitor.least_matches(2000), 30U);
}

TEST(HealthMonitor, AShareFarBelowThoseBeforeIsUnusual) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  EXPECT_EQ(monitor.least_usual_share(), 0.0);
  add_matched(0.8, 30, &monitor);
  EXPECT_NEAR(monitor.least_usual_share(), 0.736, 1e-3);
  add_matched(0.6, 60, &monitor);
  EXPECT_NEAR(monitor.least_usual_share(), 0.552, 1e-3);
  add_matched(0.4, 60, &monitor);
  EXPECT_EQ(monitor.least_usual_share(), 0.0);
}

/// Predictions that miss by draws from `sigma` in each of the six directions, with a covariance that says 1
/// cm and 1 mrad.
void add_predictions(double sigma_rad, double sigma_m, int count, HealthMonitor* monitor) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int k = 0; k < count; ++k) {
    Vector6d delta;
    for (int axis = 0; axis < 6; ++axis) delta(axis) = (axis < 3 ? sigma_rad : sigma_m) * normal(random);
    monitor->add(HealthMonitor::Prediction{moved(running().T_odom_imu(), delta), isotropic(1e-3, 0.01)},
                 running(), 0.7);
  }
}

/// Of a scan that is off by so much from a prediction with a covariance of 1 cm and 1 mrad; scans misfit by
/// as much.
double suddenness(const HealthMonitor& monitor, double angle_rad, double distance_m, bool is_shaken = false) {
  Vector6d delta = Vector6d::Zero();
  delta(2) = angle_rad;
  delta(4) = distance_m;
  const Eigen::Isometry3d T_predicted = moved(running().T_odom_imu(), delta);
  return monitor.suddenness({T_predicted, isotropic(1e-3, 0.01), is_shaken}, running());
}

TEST(HealthMonitor, AScanThatContradictsFarMoreThanOthersIsSudden) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  EXPECT_EQ(suddenness(monitor, 1.0, 1.0), 0.0);
  add_predictions(0.0, 0.0, 300, &monitor);
  // e' (P + R)^-1 e = 0.2^2 / 2 of 0.1.
  EXPECT_NEAR(suddenness(monitor, 0.2e-3, 0.0), 0.2, 1e-9);
  EXPECT_NEAR(suddenness(monitor, 0.0, 2e-3), 0.2, 1e-9);
  EXPECT_NEAR(suddenness(monitor, 1e-3, 0.01), 10.0, 1e-9);
  EXPECT_EQ(suddenness(monitor, 1.0, 1.0, true), 0.0);
  // 6 * 0.25^2 / 2 on the average.
  add_predictions(0.25e-3, 2.5e-3, 300, &monitor);
  EXPECT_LT(suddenness(monitor, 1.5e-3, 0.0), 1.0);
  EXPECT_GT(suddenness(monitor, 2.5e-3, 0.0), 1.0);
  // What the map hardly knows contradicts now and then.
  add_matched(0.4, 60, &monitor);
  EXPECT_EQ(suddenness(monitor, 1.0, 1.0), 0.0);
  add_matched(0.7, 60, &monitor);
  EXPECT_GT(suddenness(monitor, 2.5e-3, 0.0), 1.0);
  monitor.restart();
  EXPECT_EQ(suddenness(monitor, 1.0, 1.0), 0.0);
}

TEST(HealthMonitor, InnovationsThatStayLargeAreReported) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  add_predictions(0.25e-3, 2.5e-3, 300, &monitor);
  EXPECT_FALSE(reporter.has("imu_contradiction"));
  add_predictions(1e-3, 0.01, 100, &monitor);
  EXPECT_TRUE(reporter.has("imu_contradiction"));
  EXPECT_NE(reporter.take_new().front().text.find("sensor.T_imu_lidar"), std::string::npos);
}

TEST(HealthMonitor, OneLargeInnovationIsNoContradiction) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  for (int k = 0; k < 5; ++k) {
    add_predictions(0.25e-3, 2.5e-3, 59, &monitor);
    add_predictions(0.0, 0.2, 1, &monitor);
  }
  EXPECT_FALSE(reporter.has("imu_contradiction"));
}

/// A prediction that is more certain than any scan fits its map is not contradicted by the misfit.
TEST(HealthMonitor, CertaintyBeyondTheScansIsNoContradiction) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  imu::NavState state = running();
  for (int k = 0; k < 300; ++k) {
    state.t_odom_imu = Eigen::Vector3d(k % 2 == 0 ? 3e-3 : -3e-3, 0.0, 0.0);
    monitor.add(HealthMonitor::Prediction{running().T_odom_imu(), isotropic(1e-5, 1e-4)}, state, 0.7);
  }
  EXPECT_FALSE(reporter.has("imu_contradiction"));
}

TEST(HealthMonitor, ABeginningMaySettle) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  for (int beginning = 0; beginning < 3; ++beginning) {
    add_predictions(4e-3, 0.04, 25, &monitor);
    add_predictions(0.25e-3, 2.5e-3, 100, &monitor);
    monitor.restart();
  }
  EXPECT_FALSE(reporter.has("imu_contradiction"));
}

TEST(HealthMonitor, ManyUnmatchedScansInARowAreReportedAsLost) {
  Reporter reporter;
  HealthMonitor monitor(&reporter);
  for (int k = 0; k < 200; ++k) {
    if (k % 40 == 39) {
      monitor.add(std::nullopt, running(), 0.7);
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
  monitor.add(std::nullopt, state, 0.7);
  EXPECT_FALSE(reporter.has("imu_bias"));
  state.accel_bias.z() = 1.2;
  state.imu_status = imu::ImuStatus::kInitialising;
  monitor.add(std::nullopt, state, 0.7);
  EXPECT_FALSE(reporter.has("imu_bias"));
  state.imu_status = imu::ImuStatus::kInitialised;
  monitor.add(std::nullopt, state, 0.7);
  EXPECT_TRUE(reporter.has("imu_bias"));
}

}  // namespace
}  // namespace fdi_lio::odometry
