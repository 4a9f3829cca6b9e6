#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/matching/match_input.hpp"

namespace fdi_lio::matching {
namespace {

Point point_at(float x, float y, float intensity = 0.0F) {
  Point point;
  point.position = Eigen::Vector3f(x, y, 0.0F);
  point.intensity = intensity;
  return point;
}

FeatureSet features() {
  FeatureSet set;
  for (int k = 0; k < 100; ++k) set.planes.push_back(point_at(0.1F * static_cast<float>(k) + 0.05F, 1.0F));
  for (int k = 0; k < 40; ++k) set.edges.push_back(point_at(0.1F * static_cast<float>(k) + 0.05F, 2.0F));
  for (int k = 0; k < 5; ++k) set.intensity_edges.push_back(point_at(static_cast<float>(k), 3.0F, 0.5F));
  return set;
}

TEST(MatchInput, TakesTheMeanOfEachVoxelInTheBodyFrame) {
  Eigen::Isometry3d T_imu_lidar = Eigen::Isometry3d::Identity();
  T_imu_lidar.translation() = Eigen::Vector3d(0.0, 0.0, 0.7);
  const MatchInput input = make_match_input(features(), MappingConfig(), T_imu_lidar, 1.0);
  ASSERT_EQ(input.planes.size(), 10U);
  for (std::size_t k = 0; k < input.planes.size(); ++k)
    EXPECT_TRUE(input.planes[k].isApprox(Eigen::Vector3d(static_cast<double>(k) + 0.5, 1.0, 0.7), 1e-6));
  EXPECT_EQ(input.edges.size(), 8U);  // voxels of half the size
  ASSERT_EQ(input.textures.size(), 5U);
  ASSERT_EQ(input.levels.size(), 5U);
  EXPECT_EQ(input.levels[2], 0.5F);
  EXPECT_TRUE(input.plane_factors.empty());
  EXPECT_TRUE(input.origin.isApprox(T_imu_lidar.translation()));
}

TEST(MatchInput, SpinsAboutTheAxisOfTheLidar) {
  Eigen::Isometry3d T_imu_lidar = Eigen::Isometry3d::Identity();
  T_imu_lidar.linear() = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const MatchInput input = make_match_input(features(), MappingConfig(), T_imu_lidar, 1.0);
  EXPECT_TRUE(input.spin_axis.isApprox(Eigen::Vector3d(std::sin(0.5), 0.0, std::cos(0.5)), 1e-12));
}

/// A wall at y = 2.3 m, 40 times scanned against the sense of the angles, with 2 cm of noise along the beams.
std::vector<Point> noisy_wall() {
  std::vector<Point> wall;
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.02);
  for (int scan = 0; scan < 40; ++scan) {
    for (int k = 0; k < 700; ++k) {
      const double azimuth = 0.5 * M_PI + 1.22 - 2.44 * k / 700.0;
      const double range = 2.3 / std::sin(azimuth) + noise(random);
      wall.push_back(point_at(static_cast<float>(range * std::cos(azimuth)),
                              static_cast<float>(range * std::sin(azimuth))));
      wall.back().position.z() = static_cast<float>(scan);
    }
  }
  return wall;
}

// The first point of each voxel would lie 6 mm nearer than the wall on one side, and as much farther on the
// other.
TEST(MatchInput, NoiseAlongTheBeamsDoesNotTurnAWall) {
  FeatureSet set;
  set.planes = noisy_wall();
  const MatchInput input = make_match_input(set, MappingConfig(), Eigen::Isometry3d::Identity(), 0.35);
  double sum[2] = {0.0, 0.0};
  int count[2] = {0, 0};
  for (const Eigen::Vector3d& point : input.planes) {
    const int side = point.x() < 0.0 ? 0 : 1;
    sum[side] += point.y() - 2.3;
    ++count[side];
  }
  ASSERT_GT(count[0], 300);
  ASSERT_GT(count[1], 300);
  EXPECT_NEAR(sum[0] / count[0] - sum[1] / count[1], 0.0, 0.0005);
}

TEST(MatchInput, ClassesThatAreSwitchedOffStayEmpty) {
  MappingConfig config;
  config.use_edges = false;
  config.use_intensity = false;
  const MatchInput input = make_match_input(features(), config, Eigen::Isometry3d::Identity(), 1.0);
  EXPECT_FALSE(input.planes.empty());
  EXPECT_TRUE(input.edges.empty());
  EXPECT_TRUE(input.textures.empty());
}

TEST(MatchInput, PlanesAreLimitedEvenly) {
  MappingConfig config;
  config.max_planes_matched = 20;
  const MatchInput input = make_match_input(features(), config, Eigen::Isometry3d::Identity(), 0.1);
  ASSERT_EQ(input.planes.size(), 20U);
  for (std::size_t k = 1; k < input.planes.size(); ++k)
    EXPECT_NEAR(input.planes[k].x() - input.planes[k - 1].x(), 0.5, 0.11);
}

}  // namespace
}  // namespace fdi_lio::matching
