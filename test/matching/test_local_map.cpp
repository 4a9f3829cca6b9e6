#include <gtest/gtest.h>

#include "fdi_lio/matching/local_map.hpp"

namespace fdi_lio::matching {
namespace {

Eigen::Isometry3d at(double x) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = x;
  return T;
}

/// A patch of ground about the sensor, 0.4 m wide.
FeatureSet ground() {
  FeatureSet features;
  for (int k = 0; k < 16; ++k) {
    Point point;
    point.position = Eigen::Vector3f(0.05F + 0.1F * static_cast<float>(k % 4),
                                     0.05F + 0.1F * static_cast<float>(k / 4), -0.95F);
    features.planes.push_back(point);
  }
  return features;
}

std::uint32_t points_under(const LocalMap& map, const Eigen::Vector3d& position) {
  const Cell* cell = map.planes().find_plane(position, false);
  return cell == nullptr ? 0 : cell->count;
}

TEST(LocalMap, ScansOfAStandingSensorStopEntering) {
  LocalMap map{MappingConfig()};
  EXPECT_TRUE(map.empty());
  const Eigen::Vector3d spot(0.2, 0.2, -0.95);
  for (int k = 0; k < 10; ++k) map.insert(ground(), at(0.0), Eigen::Isometry3d::Identity());
  const std::uint32_t first = points_under(map, spot);
  EXPECT_EQ(first, 160U);
  for (int k = 0; k < 10; ++k) map.insert(ground(), at(0.001 * k), Eigen::Isometry3d::Identity());
  EXPECT_EQ(points_under(map, spot), first);
  map.insert(ground(), at(0.06), Eigen::Isometry3d::Identity());
  EXPECT_GT(points_under(map, spot), first);
}

TEST(LocalMap, ForgetsWhatIsFarAway) {
  MappingConfig config;
  config.map_radius_m = 50.0;
  LocalMap map(config);
  for (int k = 0; k <= 30; ++k) map.insert(ground(), at(4.0 * k), Eigen::Isometry3d::Identity());
  EXPECT_EQ(points_under(map, Eigen::Vector3d(0.2, 0.2, -0.95)), 0U);
  EXPECT_GT(points_under(map, Eigen::Vector3d(120.2, 0.2, -0.95)), 0U);
}

TEST(LocalMap, ShowsTheMeansOfItsCells) {
  LocalMap map{MappingConfig()};
  Eigen::Isometry3d T_imu_lidar = Eigen::Isometry3d::Identity();
  T_imu_lidar.translation().z() = 0.5;
  map.insert(ground(), at(0.0), T_imu_lidar);
  const std::vector<Point> points = map.points();
  ASSERT_EQ(points.size(), 1U);
  EXPECT_TRUE(points[0].position.isApprox(Eigen::Vector3f(0.2F, 0.2F, -0.45F), 1e-4F));
}

}  // namespace
}  // namespace fdi_lio::matching
