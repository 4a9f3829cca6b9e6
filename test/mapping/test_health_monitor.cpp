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

/// Predictions that miss by draws from `sigma` in each of the six directions, with a covariance that says 1
/// cm and 1 mrad.
void add_predictions(double sigma_rad, double sigma_m, int count, HealthMonitor* monitor) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int k = 0; k < count; ++k) {
    Vector6d delta;
    for (int axis = 0; axis < 6; ++axis) delta(axis) = (axis < 3 ? sigma_rad : sigma_m) * normal(random);
    monitor->add(HealthMonitor::Prediction{moved(running().T_odom_imu(), delta), isotropic(1e-3, 0.01)},
                 running());
  }
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
    monitor.add(HealthMonitor::Prediction{running().T_odom_imu(), isotropic(1e-5, 1e-4)}, state);
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
      monitor.add(std::nullopt, running());
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
  monitor.add(std::nullopt, state);
  EXPECT_FALSE(reporter.has("imu_bias"));
  state.accel_bias.z() = 1.2;
  state.imu_status = imu::ImuStatus::kInitialising;
  monitor.add(std::nullopt, state);
  EXPECT_FALSE(reporter.has("imu_bias"));
  state.imu_status = imu::ImuStatus::kInitialised;
  monitor.add(std::nullopt, state);
  EXPECT_TRUE(reporter.has("imu_bias"));
}

}  // namespace
}  // namespace fdi_lio::mapping
