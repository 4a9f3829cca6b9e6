#include <gtest/gtest.h>

#include "fdi_lio/mapping/match_input.hpp"

namespace fdi_lio::mapping {
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

TEST(MatchInput, KeepsTheFirstPointOfEachVoxelInTheBodyFrame) {
  Eigen::Isometry3d T_imu_lidar = Eigen::Isometry3d::Identity();
  T_imu_lidar.translation() = Eigen::Vector3d(0.0, 0.0, 0.7);
  const MatchInput input = make_match_input(features(), MappingConfig(), T_imu_lidar, 1.0);
  ASSERT_EQ(input.planes.size(), 10U);
  for (std::size_t k = 0; k < input.planes.size(); ++k)
    EXPECT_TRUE(input.planes[k].isApprox(Eigen::Vector3d(static_cast<double>(k) + 0.05, 1.0, 0.7), 1e-6));
  EXPECT_EQ(input.edges.size(), 8U);  // voxels of half the size
  ASSERT_EQ(input.textures.size(), 5U);
  ASSERT_EQ(input.levels.size(), 5U);
  EXPECT_EQ(input.levels[2], 0.5F);
  EXPECT_TRUE(input.plane_trust.empty());
  EXPECT_TRUE(input.origin.isApprox(T_imu_lidar.translation()));
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
}  // namespace fdi_lio::mapping
