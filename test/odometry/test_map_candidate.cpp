#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/odometry/map_candidate.hpp"

namespace fdi_lio::odometry {
namespace {

/// What a lidar sees of a room of 20 x 12 m, 4 m high, from a place in it: other spots each time.
FeatureSet room_seen_from(const Eigen::Vector3d& position, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  FeatureSet features;
  const auto add = [&](const Eigen::Vector3f& corner, const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    for (int k = 0; k < 2500; ++k) {
      Point point;
      point.position = corner + uniform(random) * a + uniform(random) * b - position.cast<float>();
      features.planes.push_back(point);
    }
  };
  const Eigen::Vector3f x(20.0F, 0.0F, 0.0F), y(0.0F, 12.0F, 0.0F), z(0.0F, 0.0F, 4.0F);
  const Eigen::Vector3f corner(-10.0F, -6.0F, -1.5F);
  add(corner, x, y);
  add(corner, x, z);
  add(corner, y, z);
  add(corner + x, y, z);
  add(corner + y, x, z);
  return features;
}

/// Points all about the lidar, somewhere else each time: what rain or a hand in front of it show.
FeatureSet nothing_twice(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-8.0F, 8.0F);
  FeatureSet features;
  for (int k = 0; k < 3000; ++k) {
    Point point;
    point.position = Eigen::Vector3f(uniform(random), uniform(random), uniform(random));
    features.planes.push_back(point);
  }
  return features;
}

imu::NavState at(const Eigen::Vector3d& position) {
  imu::NavState state;
  state.t_odom_imu = position;
  return state;
}

class Candidate : public testing::Test {
 protected:
  bool add(const FeatureSet& features, const Eigen::Vector3d& predicted) {
    const matching::MatchInput input = matching::make_match_input(
        features, config_.mapping, Eigen::Isometry3d::Identity(), config_.mapping.feature_voxel_m);
    return candidate_.add(features, input, at(predicted));
  }

  Config config_;
  MapCandidate candidate_{config_};
};

TEST_F(Candidate, ScansThatKnowEachOtherBecomeAMap) {
  // The prediction knows the motion, not the place.
  const Eigen::Vector3d elsewhere(300.0, -20.0, 5.0);
  int scans = 0;
  bool is_map = false;
  while (!is_map && scans < 10) {
    const Eigen::Vector3d position(0.3 * scans, 0.0, 0.0);
    is_map = add(room_seen_from(position, static_cast<unsigned>(scans)), elsewhere + position);
    ++scans;
  }
  EXPECT_TRUE(is_map);
  EXPECT_GE(scans, 5);
  const matching::LocalMap map = candidate_.take();
  const matching::Cell* wall = map.planes().find_plane(elsewhere + Eigen::Vector3d(10.0, 1.0, 0.5), true);
  ASSERT_NE(wall, nullptr);
  EXPECT_GT(std::abs(wall->axes.col(0).x()), 0.95);
  EXPECT_TRUE(candidate_.take().empty());
}

TEST_F(Candidate, ScansThatKnowNothingDoNot) {
  for (unsigned k = 0; k < 20; ++k) EXPECT_FALSE(add(nothing_twice(k), Eigen::Vector3d(0.3 * k, 0.0, 0.0)));
}

/// The lidar sees the same wherever it goes: so that is on the lidar. On the last way three of five walls
/// match in spite of the motion.
TEST_F(Candidate, WhatMovesAlongDoesNot) {
  for (const Eigen::Vector3d& step : {Eigen::Vector3d(0.5, 0.4, 0.3), Eigen::Vector3d(0.2, 0.0, 0.0)}) {
    candidate_.reset();
    for (unsigned k = 0; k < 20; ++k)
      EXPECT_FALSE(add(room_seen_from(Eigen::Vector3d::Zero(), k), k * step)) << step.transpose();
  }
}

TEST_F(Candidate, AMatchInBetweenBeginsAnew) {
  for (unsigned k = 0; k < 12; ++k) {
    if (k % 4 == 3) candidate_.reset();
    EXPECT_FALSE(add(room_seen_from(Eigen::Vector3d::Zero(), k), Eigen::Vector3d::Zero()));
  }
}

}  // namespace
}  // namespace fdi_lio::odometry
