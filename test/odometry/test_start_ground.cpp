#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "fdi_lio/odometry/start_ground.hpp"

namespace fdi_lio::odometry {
namespace {

Eigen::Vector3d tilted(double degrees) {
  return Eigen::AngleAxisd(degrees * M_PI / 180.0, Eigen::Vector3d::UnitY()) * Eigen::Vector3d::UnitZ();
}

/// Ground 1.8 m below the lidar and a wall on either side, so many points of each per metre.
FeatureSet between_walls(int ground, int walls) {
  FeatureSet features;
  const auto add = [&features](double x, double y, double z) {
    Point point;
    point.position = Eigen::Vector3d(x, y, z).cast<float>();
    features.planes.push_back(point);
  };
  for (int x = -15; x <= 15; ++x) {
    for (int k = 0; k < ground; ++k) add(x, 6.0 * k / ground - 3.0, -1.8);
    for (int k = 0; k < walls; ++k) {
      const double height = -1.5 + 4.0 * k / walls;
      add(x + 0.3, -3.0 - 0.3 * height, height);
      add(x + 0.6, 3.0 + 0.3 * height, height);
    }
  }
  return features;
}

TEST(StartGround, IsFoundBetweenWallsInTheAxesOfOdom) {
  const Eigen::Matrix3d R_odom_lidar =
      (Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.12, Eigen::Vector3d::UnitY()))
          .toRotationMatrix();
  const auto normal = find_ground(between_walls(20, 40), R_odom_lidar);
  ASSERT_TRUE(normal);
  EXPECT_LT((*normal - R_odom_lidar.col(2)).norm(), 1e-3);
}

TEST(StartGround, IsNoneWhereHardlyAnythingLies) {
  EXPECT_FALSE(find_ground(between_walls(3, 40), Eigen::Matrix3d::Identity()));
  EXPECT_FALSE(find_ground(FeatureSet(), Eigen::Matrix3d::Identity()));
}

/// A bench, a ledge: what is below it is seen.
TEST(StartGround, IsNotWhatPointsLieBelow) {
  FeatureSet features = between_walls(20, 40);
  FeatureSet below = between_walls(8, 0);
  for (Point& point : below.planes) {
    point.position.z() -= 0.6F + 0.1F * std::abs(point.position.y());
    features.planes.push_back(point);
  }
  EXPECT_FALSE(find_ground(features, Eigen::Matrix3d::Identity()));
}

TEST(StartGround, IsSteepFromFiveDegreesOn) {
  EXPECT_FALSE(is_steep(tilted(7.0), tilted(2.5)));
  EXPECT_TRUE(is_steep(tilted(7.0), tilted(1.5)));
  EXPECT_TRUE(is_steep(tilted(-3.0), tilted(2.5)));
}

}  // namespace
}  // namespace fdi_lio::odometry
