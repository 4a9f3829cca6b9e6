#include <gtest/gtest.h>

#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {
namespace {

TEST(MapBuilder, GivesOneMeanPointAVoxel) {
  MapBuilder builder(1.0);
  Point a;
  a.position = Eigen::Vector3f(0.2F, 0.2F, 0.2F);
  a.intensity = 10.0F;
  Point b = a;
  b.position.x() = 0.6F;
  b.intensity = 30.0F;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = 5.0;
  builder.add({a, b}, T);
  ASSERT_EQ(builder.size(), 1U);
  const Point mean = builder.points().front();
  EXPECT_LT((mean.position - Eigen::Vector3f(5.4F, 0.2F, 0.2F)).norm(), 1e-5F);
  EXPECT_NEAR(mean.intensity, 20.0F, 1e-5F);
}

TEST(MapBuilder, LeavesOutVoxelsThatAreNotAccepted) {
  MapBuilder builder(0.5);
  Point a;
  a.position = Eigen::Vector3f(-0.1F, 0.2F, 0.2F);
  Point b;
  b.position = Eigen::Vector3f(0.1F, 0.2F, 0.2F);
  builder.add_if({a, b}, Eigen::Isometry3d::Identity(),
                 [](const Eigen::Vector3i& cell) { return cell.x() == -1; });
  ASSERT_EQ(builder.size(), 1U);
  EXPECT_LT((builder.points().front().position - a.position).norm(), 1e-6F);
}

}  // namespace
}  // namespace fdi_lio::mapping
