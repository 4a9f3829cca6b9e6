#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <random>

#include "synthetic_street.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/estimator.hpp"

namespace fdi_lio::odometry {
namespace {

/// Of a sensor that stands, deskewed as if it moved along x with `v_deskew_mps`.
FeatureSet standing_scan(int k, double v_deskew_mps = 0.0) {
  return SyntheticStreet().scan(kPeriod_s * k, 0.0, 0.0, v_deskew_mps, static_cast<unsigned>(k + 1));
}

/// What its IMU feels, and besides that `ahead_mps2`.
imu::Preintegration standing_imu(int k, double ahead_mps2 = 0.0) {
  imu::Preintegration imu =
      steady_imu(kPeriod_s * k, Eigen::Vector3d(ahead_mps2, 0.0, SensorConfig().gravity_mps2));
  imu.recent.acceleration_std = 0.01;
  return imu;
}

/// As a sensor sees the features that has turned by `turned_at(time of the point)` [rad] about the vertical.
void turn(const std::function<double(double)>& turned_at, FeatureSet* features) {
  for (Point& point : features->planes) {
    const Eigen::Quaterniond q = so3::exp_q(-turned_at(point.time_s) * Eigen::Vector3d::UnitZ());
    point.position = (q * point.position.cast<double>()).cast<float>();
  }
}

/// A gyro that feels nothing of a turn, of which all happens in one scan of a sensor that stands: that scan
/// is sheared. Nobody learns from it, and it is no keyframe; the next that is not sheared is.
TEST(Estimator, AScanThatTheGyroDeskewedWronglyIsNotLearnedFrom) {
  constexpr int kTurned = 20;
  constexpr double kTurn = 40.0 * M_PI / 180.0;
  Config config;
  config.mapping.keyframe_distance_m = 1.0;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  std::size_t voxels = 0;
  bool is_turned_keyframe = false;
  for (int k = 0; k < kTurned + 8; ++k) {
    FeatureSet features = standing_scan(k);
    // The turn takes the middle fifth of the scan.
    turn(
        [k](double time_s) {
          const double share = std::clamp(5.0 * (time_s / kPeriod_s + 0.6), 0.0, 1.0);
          return k < kTurned ? 0.0 : (k == kTurned ? share * kTurn : kTurn);
        },
        &features);
    const auto result = estimator.add(features, degeneracy::Degeneracy(), standing_imu(k));
    ASSERT_TRUE(result);
    if (k == kTurned - 1) voxels = estimator.map_voxel_count();
    if (k == kTurned) {
      EXPECT_TRUE(reporter.has("gyro_missed"));
      EXPECT_FALSE(result->is_keyframe);
      EXPECT_EQ(estimator.map_voxel_count(), voxels);
    }
    if (k > kTurned) is_turned_keyframe = is_turned_keyframe || result->is_keyframe;
  }
  EXPECT_TRUE(is_turned_keyframe);
  const imu::NavState end = *estimator.state();
  EXPECT_LT(end.q_odom_imu.angularDistance(so3::exp_q(kTurn * Eigen::Vector3d::UnitZ())), 0.005);
  EXPECT_LT(end.t_odom_imu.norm(), 0.05);
  EXPECT_LT(end.v_odom.norm(), 0.05);
  EXPECT_LT(end.gyro_bias.norm(), 0.01);
}

/// A gyro that feels nothing of two degrees about the vertical in half a second, of which the ground, most of
/// each scan, feels nothing either.
TEST(Estimator, ASlowTurnThatTheGyroMissesIsFound) {
  constexpr int kTurned = 40;
  constexpr int kTurning = 5;
  constexpr double kTurn = 2.0 * M_PI / 180.0;
  Config config;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  for (int k = 0; k < kTurned + 20; ++k) {
    FeatureSet features = standing_scan(k);
    turn(
        [k](double time_s) {
          const double scans = k - kTurned + 1 + time_s / kPeriod_s;
          return std::clamp(scans / kTurning, 0.0, 1.0) * kTurn;
        },
        &features);
    ASSERT_TRUE(estimator.add(features, degeneracy::Degeneracy(), standing_imu(k)));
    EXPECT_FALSE(k < kTurned && reporter.has("gyro_missed")) << k;
  }
  EXPECT_TRUE(reporter.has("gyro_missed"));
  const imu::NavState end = *estimator.state();
  EXPECT_LT(end.q_odom_imu.angularDistance(so3::exp_q(kTurn * Eigen::Vector3d::UnitZ())), 0.003);
  EXPECT_LT(end.t_odom_imu.norm(), 0.03);
  EXPECT_LT(end.gyro_bias.norm(), 0.003);
}

/// Leaves in the air, elsewhere in each scan: nothing matches them.
void add_leaves(int count, unsigned seed, FeatureSet* features) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int k = 0; k < count; ++k) {
    const double x = -15.0 + 20.0 * uniform(random);
    const double y = 8.0 * uniform(random);
    Point point;
    point.position = Eigen::Vector3d(x, y, 4.0 + 8.0 * uniform(random)).cast<float>();
    features->planes.push_back(point);
  }
}

/// A sensor stands whose accelerometer feels something ahead for half a second, as if a car set off. Few
/// fronts tell the way along, and what a scan moves the estimate by hardly tells that it is wrong. Meanwhile
/// the air fills with leaves.
void expect_that_it_stands(double felt_mps2, int leaves) {
  SCOPED_TRACE(felt_mps2);
  constexpr int kStruck = 40;
  constexpr int kScans = 5;
  Config config;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  for (int k = 0; k < kStruck + 20; ++k) {
    const double ahead_mps2 = k >= kStruck && k < kStruck + kScans ? felt_mps2 : 0.0;
    const double v_before = k > 0 ? estimator.state()->v_odom.x() : 0.0;
    FeatureSet features = standing_scan(k, v_before + 0.5 * kPeriod_s * ahead_mps2);
    add_leaves(leaves * std::clamp(k - kStruck + 3, 0, kScans) / kScans, static_cast<unsigned>(k), &features);
    ASSERT_TRUE(estimator.add(features, degeneracy::Degeneracy(), standing_imu(k, ahead_mps2)));
    EXPECT_FALSE(k < kStruck && reporter.has("accel_missed")) << k;
  }
  EXPECT_TRUE(reporter.has("accel_missed"));
  EXPECT_FALSE(reporter.has("gyro_missed"));
  const imu::NavState end = *estimator.state();
  EXPECT_LT(end.t_odom_imu.norm(), 0.1);
  EXPECT_LT(end.v_odom.norm(), 0.2);
  EXPECT_LT(end.accel_bias.norm(), 0.1);
}

TEST(Estimator, AnAccelerationThatTheScansContradictIsNotBelieved) {
  for (const double felt_mps2 : {0.5, 1.0, 3.0}) expect_that_it_stands(felt_mps2, 0);
}

TEST(Estimator, AFalseAccelerationIsFoundWhereTheShareOfMatchesFalls) { expect_that_it_stands(1.0, 500); }

/// An open road with rails on both sides, of which nothing tells the way along but the rears of vehicles that
/// stand when the sensor does, and drive along as it sets off.
FeatureSet scan_in_traffic(int k, double speed_mps, double v_deskew_mps) {
  std::mt19937 random(static_cast<unsigned>(k + 1));
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.02);
  FeatureSet features;
  features.stamp = static_cast<Stamp>(std::llround(1e9 * kPeriod_s * k));
  const auto add = [&](const Eigen::Vector3d& from_end, double v_place_mps) {
    Point point;
    point.time_s = static_cast<float>(-kPeriod_s * uniform(random));
    Eigen::Vector3d seen = from_end + Eigen::Vector3d(noise(random), noise(random), noise(random));
    seen.x() += (v_deskew_mps - speed_mps + v_place_mps) * point.time_s;
    point.position = seen.cast<float>();
    features.planes.push_back(point);
  };
  for (int i = 0; i < 4000; ++i) {
    add({-20.0 + 40.0 * uniform(random), -10.0 + 20.0 * uniform(random), -1.7}, 0.0);
    const double side = i % 2 == 0 ? 10.0 : -10.0;
    add({-20.0 + 40.0 * uniform(random), side, -1.7 + uniform(random)}, 0.0);
  }
  for (const double rear : {8.0, 13.0, 19.0}) {
    for (int i = 0; i < 18; ++i)
      add({rear, -4.0 + 2.0 * uniform(random), -1.5 + 1.5 * uniform(random)}, speed_mps);
  }
  return features;
}

/// The IMU says that the sensor sets off; what sets off with it says that it stands.
TEST(Estimator, WhatTravelsAlongIsNoBlow) {
  constexpr int kStanding = 40;
  constexpr double kAcceleration = 2.0;
  Config config;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  double speed_mps = 0.0;
  double here_m = 0.0;
  for (int k = 0; k < kStanding + 20; ++k) {
    const double ahead_mps2 = k >= kStanding ? kAcceleration : 0.0;
    here_m += kPeriod_s * (speed_mps + 0.5 * kPeriod_s * ahead_mps2);
    speed_mps += kPeriod_s * ahead_mps2;
    const double v_before = k > 0 ? estimator.state()->v_odom.x() : 0.0;
    const FeatureSet features = scan_in_traffic(k, speed_mps, v_before + 0.5 * kPeriod_s * ahead_mps2);
    ASSERT_TRUE(estimator.add(features, degeneracy::Degeneracy(), standing_imu(k, ahead_mps2)));
  }
  EXPECT_FALSE(reporter.has("accel_missed"));
  EXPECT_NEAR(estimator.state()->v_odom.x(), speed_mps, 0.3);
  EXPECT_NEAR(estimator.state()->t_odom_imu.x(), here_m, 0.3);
}

}  // namespace
}  // namespace fdi_lio::odometry
