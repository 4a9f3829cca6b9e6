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

TEST(MapBuilder, FindsTheVoxelsAsAFloorInDoubleDoes) {
  // Far from the origin, turned, and on both sides of it.
  Eigen::Isometry3d T(Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.3, -0.2, 0.9).normalized()));
  T.pretranslate(Eigen::Vector3d(-2000.0, 3000.0, -7.0));
  std::vector<Point> points;
  for (int i = 0; i < 1000; ++i) {
    Point point;
    point.position = Eigen::Vector3f(0.11F * static_cast<float>(i - 500), 0.07F * static_cast<float>(i % 50),
                                     -0.013F * static_cast<float>(i));
    points.push_back(point);
  }
  for_each_cell(points, T, 0.2,
                [&](const Point& p, const Eigen::Vector3f& offset, const Eigen::Vector3i& cell) {
                  const Eigen::Vector3d expected = T * p.position.cast<double>() / 0.2;
                  EXPECT_LT((cell.cast<double>() + offset.cast<double>() - expected).norm(), 1e-3);
                  EXPECT_GE(offset.minCoeff(), 0.0F);
                  EXPECT_LE(offset.maxCoeff(), 1.0F);
                });
}

TEST(MapBuilder, BeginsAnewWhenCleared) {
  MapBuilder builder(0.5);
  Point a;
  a.position = Eigen::Vector3f(0.1F, 0.2F, 0.2F);
  builder.add({a}, Eigen::Isometry3d::Identity());
  builder.clear();
  EXPECT_TRUE(builder.points().empty());
  Point b = a;
  b.position.x() = 0.3F;
  builder.add({b}, Eigen::Isometry3d::Identity());
  ASSERT_EQ(builder.size(), 1U);
  EXPECT_LT((builder.points().front().position - b.position).norm(), 1e-6F);
}

}  // namespace
}  // namespace fdi_lio::mapping
