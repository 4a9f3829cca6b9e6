#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/odometry/turn_search.hpp"

namespace fdi_lio::odometry {
namespace {

constexpr double kDegree = M_PI / 180.0;

/// Floor, two walls, and the ends of a corridor of 30 x 3 m, in the frame of the map.
class Corridor : public ::testing::Test {
 protected:
  explicit Corridor(double half_width_of_floor = 1.5) {
    std::normal_distribution<double> noise(0.0, 0.01);
    for (int k = 0; k < 60000; ++k) {
      const double along = uniform(-15.0, 15.0);
      add({along, uniform(-half_width_of_floor, half_width_of_floor), noise(random_)});
      add({along, (k % 2 == 0 ? -1.5 : 1.5) + noise(random_), uniform(0.0, 2.5)});
      if (k % 10 == 0)
        add({(k % 20 == 0 ? -15.0 : 15.0) + noise(random_), uniform(-1.5, 1.5), uniform(0.0, 2.5)});
    }
    map_.insert(points_, std::vector<float>(points_.size(), 0.0F),
                Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 1.0)));
  }

  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  void add(const Eigen::Vector3d& point) { points_.push_back(point); }

  std::vector<Eigen::Vector3d> seen_from(const Eigen::Isometry3d& T_map_imu) const {
    std::vector<Eigen::Vector3d> seen;
    for (std::size_t k = 0; k < points_.size(); k += 97) seen.push_back(T_map_imu.inverse() * points_[k]);
    return seen;
  }

  std::mt19937 random_{3};
  std::vector<Eigen::Vector3d> points_;
  matching::VoxelMap map_{matching::VoxelMapConfig()};
};

/// A road between railings: most of a scan is ground, which lies on itself after any turn about the vertical.
class Road : public Corridor {
 protected:
  Road() : Corridor(15.0) {}
};

Eigen::Isometry3d pose(const Eigen::Vector3d& rotation, const Eigen::Vector3d& position) {
  Eigen::Isometry3d T(so3::exp_q(rotation));
  T.pretranslate(position);
  return T;
}

TEST_F(Corridor, FindsWhatTheGyroMissed) {
  const Eigen::Isometry3d T_predicted = pose({0.1, -0.05, 0.3}, {2.0, 0.2, 1.2});
  for (const Eigen::Vector3d& missed : {Eigen::Vector3d(0.0, 0.0, 30.0), Eigen::Vector3d(-17.0, 0.0, 0.0),
                                        Eigen::Vector3d(10.0, 20.0, -12.0), Eigen::Vector3d(0.0, 7.0, 0.0)}) {
    const Eigen::Vector3d turn = kDegree * missed;
    const auto found = find_turn(map_, seen_from(T_predicted * so3::exp_q(turn)), T_predicted);
    ASSERT_TRUE(found) << missed.transpose();
    EXPECT_LT(so3::exp_q(*found).angularDistance(so3::exp_q(turn)), 2.5 * kDegree) << missed.transpose();
  }
}

TEST_F(Road, FindsATurnThatTheGroundDoesNotFeel) {
  const Eigen::Isometry3d T_predicted = pose({0.0, 0.0, 0.3}, {2.0, 0.2, 1.2});
  const Eigen::Vector3d turn(0.0, 0.0, 3.0 * kDegree);
  std::vector<Eigen::Vector3d> seen;
  std::size_t others = 0;
  for (const Eigen::Vector3d& point : seen_from(T_predicted * so3::exp_q(turn))) {
    if (point.norm() > 12.0) continue;
    const bool is_ground = (T_predicted * so3::exp_q(turn) * point).z() < 0.1;
    if (is_ground || others++ % 28 == 0) seen.push_back(point);
  }
  const auto found = find_turn(map_, seen, T_predicted);
  ASSERT_TRUE(found);
  EXPECT_LT(so3::exp_q(*found).angularDistance(so3::exp_q(turn)), 2.5 * kDegree);
}

TEST_F(Corridor, FindsNothingWhereNothingWasMissed) {
  const Eigen::Isometry3d T = pose({0.1, -0.05, 0.3}, {2.0, 0.2, 1.2});
  EXPECT_FALSE(find_turn(map_, seen_from(T), T));
  EXPECT_FALSE(find_turn(map_, {}, T));
  EXPECT_FALSE(find_turn(matching::VoxelMap(matching::VoxelMapConfig()), seen_from(T), T));
}

TEST(TurnSearch, DeskewsWithTheTurn) {
  // Lidar at (1, 0, 0) of the IMU; a quarter turn about z was missed over 0.1 s, half of it after the point.
  FeatureSet features;
  features.planes.resize(1);
  features.planes[0].position = Eigen::Vector3f(1.0F, 0.0F, 0.0F);
  features.planes[0].time_s = -0.05F;
  const Eigen::Isometry3d T_imu_lidar(Eigen::Translation3d(1.0, 0.0, 0.0));
  const FeatureSet turned =
      turned_while_scanned(features, Eigen::Vector3d(0.0, 0.0, M_PI / 2.0), 0.1, T_imu_lidar);
  const double half = std::sqrt(0.5);
  const Eigen::Vector3f expected(static_cast<float>(2.0 * half - 1.0), static_cast<float>(-2.0 * half), 0.0F);
  EXPECT_LT((turned.planes[0].position - expected).norm(), 1e-6F);
}

}  // namespace
}  // namespace fdi_lio::odometry
