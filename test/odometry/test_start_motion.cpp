#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "synthetic_places.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/odometry/start_motion.hpp"

namespace fdi_lio::odometry {
namespace {

std::vector<Eigen::Vector3d> positions(const mapping::KeyframeCloud& cloud) {
  std::vector<Eigen::Vector3d> result;
  for (const Point& point : cloud.planes) result.push_back(point.position.cast<double>());
  return result;
}

FeatureSet features_of(const mapping::KeyframeCloud& cloud, Stamp stamp) {
  FeatureSet features;
  features.stamp = stamp;
  features.planes = cloud.planes;
  return features;
}

imu::NavState state_at(Stamp stamp, const Eigen::Quaterniond& q_odom_imu = Eigen::Quaterniond::Identity()) {
  imu::NavState state;
  state.stamp = stamp;
  state.q_odom_imu = q_odom_imu;
  return state;
}

constexpr Stamp kTenth = 100000000;

TEST(StartMotion, FindsTheDisplacementOfATown) {
  const mapping::SyntheticWorld town = mapping::make_town(1);
  const Eigen::Isometry3d begin = mapping::planar_pose(25.0, -10.0, 0.0);
  for (const Eigen::Vector3d& moved :
       {Eigen::Vector3d(1.3, 0.0, 0.0), Eigen::Vector3d(-0.8, 0.9, 0.0), Eigen::Vector3d(0.0, -4.1, 0.0)}) {
    const std::vector<Eigen::Vector3d> before = positions(town.seen_from(begin, 1));
    const std::vector<Eigen::Vector3d> now =
        positions(town.seen_from(begin * Eigen::Translation3d(moved), 2));
    const StartMotion motion = find_start_motion(before, now, Eigen::Vector3d::Zero(), 4.5);
    EXPECT_LT((motion.displacement - moved).norm(), 0.4) << moved.transpose();
    EXPECT_GT(motion.score, 2.0 * std::max(motion.score_predicted, 1.0)) << moved.transpose();
  }
}

TEST(StartMotion, AtRestNothingIsBetterThanRest) {
  const mapping::SyntheticWorld town = mapping::make_town(2);
  const Eigen::Isometry3d place = mapping::planar_pose(25.0, 5.0, 0.0);
  const FeatureSet first = features_of(town.seen_from(place, 1), 0);
  const FeatureSet second = features_of(town.seen_from(place, 2), kTenth);
  EXPECT_FALSE(
      start_velocity(first, state_at(0), second, state_at(kTenth), false, Eigen::Isometry3d::Identity()));
}

/// Walls along the way look the same everywhere, and beams meet other spots each time.
TEST(StartMotion, WhatDoesNotShowTheWaySaysNothing) {
  const auto seen = [](unsigned spots, double x) {
    mapping::SyntheticWorld tunnel(spots);
    tunnel.add({-100.0, -4.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 8.0, 0.0}, 50.0);
    tunnel.add({-100.0, -4.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 0.0, 5.0}, 50.0);
    tunnel.add({-100.0, 4.0, -1.7}, {200.0, 0.0, 0.0}, {0.0, 0.0, 5.0}, 50.0);
    return tunnel.seen_from(mapping::planar_pose(x, 0.0, 0.0), spots);
  };
  const FeatureSet first = features_of(seen(1, 0.0), 0);
  const FeatureSet second = features_of(seen(2, 1.5), kTenth);
  EXPECT_FALSE(
      start_velocity(first, state_at(0), second, state_at(kTenth), false, Eigen::Isometry3d::Identity()));
}

/// Nearly half of what is seen travels with the sensor. A smooth IMU makes rest the only alternative, and the
/// scans of one that stands are alike.
TEST(StartMotion, AnImuThatIsCalmNeedsLess) {
  constexpr int kTravelling = 950;
  constexpr int kStanding = 1045;
  const Eigen::Vector3d step(1.25, 0.0, 0.0);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> side(-38.0, 38.0);
  std::uniform_real_distribution<double> height(-4.0, 4.0);
  FeatureSet first;
  FeatureSet second;
  second.stamp = kTenth;
  for (int k = 0; k < kTravelling + kStanding; ++k) {
    const Eigen::Vector3d seen(side(random), side(random), height(random));
    Point point;
    point.position = seen.cast<float>();
    first.planes.push_back(point);
    if (k >= kTravelling) point.position = (seen - step).cast<float>();
    second.planes.push_back(point);
  }
  const Eigen::Isometry3d T_imu_lidar = Eigen::Isometry3d::Identity();
  EXPECT_FALSE(start_velocity(first, state_at(0), second, state_at(kTenth), false, T_imu_lidar));
  const auto found = start_velocity(first, state_at(0), second, state_at(kTenth), true, T_imu_lidar);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->is_clear);
  EXPECT_LT((found->v_odom - step / 0.1).norm(), 4.0);
  FeatureSet again = first;
  again.stamp = kTenth;
  EXPECT_FALSE(start_velocity(first, state_at(0), again, state_at(kTenth), true, T_imu_lidar));
}

/// The lidar looks left, the vehicle turns while it drives, and `odom` is turned against both.
TEST(StartMotion, VelocityIsThatOfTheOdometryFrame) {
  const mapping::SyntheticWorld town = mapping::make_town(3);
  const Eigen::Isometry3d T_imu_lidar = mapping::planar_pose(0.0, 0.0, 0.5 * M_PI);
  const Eigen::Isometry3d T_odom_town = mapping::planar_pose(0.0, 0.0, 0.8);
  const Eigen::Isometry3d T_town_first = mapping::planar_pose(25.0, -8.0, 0.5 * M_PI);
  const Eigen::Isometry3d T_town_second = T_town_first * mapping::planar_pose(1.4, 0.1, 0.05);
  const auto scan = [&](const Eigen::Isometry3d& T_town_imu, unsigned seed, Stamp stamp) {
    return features_of(town.seen_from(T_town_imu * T_imu_lidar, seed), stamp);
  };
  const auto state = [&](const Eigen::Isometry3d& T_town_imu, Stamp stamp) {
    return state_at(stamp, Eigen::Quaterniond((T_odom_town * T_town_imu).linear()));
  };
  const std::optional<StartVelocity> found =
      start_velocity(scan(T_town_first, 1, 0), state(T_town_first, 0), scan(T_town_second, 2, kTenth),
                     state(T_town_second, kTenth), false, T_imu_lidar);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->is_clear);
  const Eigen::Vector3d expected =
      T_odom_town.linear() * (T_town_second.translation() - T_town_first.translation()) / 0.1;
  EXPECT_LT((found->v_odom - expected).norm(), 4.0);
  // Scans that do not follow each other, or after a gap, have none.
  EXPECT_FALSE(start_velocity(scan(T_town_first, 1, 0), state(T_town_first, 0),
                              scan(T_town_second, 2, 4 * kTenth), state(T_town_second, 4 * kTenth), false,
                              T_imu_lidar));
  EXPECT_FALSE(start_velocity(scan(T_town_first, 1, 0), state(T_town_first, 0), scan(T_town_second, 2, 0),
                              state(T_town_second, 0), false, T_imu_lidar));
}

/// A wall ahead that comes nearer while the sweep goes over it is straight when the velocity is right.
TEST(StartMotion, MovedWhileScannedStraightensAWall) {
  const double speed = 13.0;
  FeatureSet features;
  for (int k = 0; k <= 10; ++k) {
    Point point;
    point.time_s = -0.01F * static_cast<float>(k);
    // The lidar's x points back: the wall 20 m ahead at the end of the sweep was farther before.
    point.position = {static_cast<float>(-(20.0 - speed * point.time_s)), static_cast<float>(k), 0.0F};
    features.planes.push_back(point);
    features.edges.push_back(point);
    features.intensity_edges.push_back(point);
  }
  imu::NavState state = state_at(0, Eigen::Quaterniond(so3::exp(Eigen::Vector3d(0.0, 0.0, 0.3))));
  state.v_odom = state.q_odom_imu * Eigen::Vector3d(speed, 0.0, 0.0);
  const FeatureSet moved = moved_while_scanned(features, state, mapping::planar_pose(0.5, 0.0, M_PI));
  for (const std::vector<Point>* points : {&moved.planes, &moved.edges, &moved.intensity_edges}) {
    ASSERT_EQ(points->size(), 11U);
    for (const Point& point : *points) EXPECT_NEAR(point.position.x(), -20.0F, 1e-4F);
    EXPECT_NEAR(points->back().position.y(), 10.0F, 1e-4F);
  }
}

}  // namespace
}  // namespace fdi_lio::odometry
