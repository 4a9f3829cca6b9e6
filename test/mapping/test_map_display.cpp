#include <algorithm>
#include <cstddef>
#include <vector>

#include "synthetic_drive.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/mapping/map_display.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr double kVoxelM = 0.4;

/// Share of every eleventh of the points that are more than a voxel from every true surface point.
double share_off(const std::vector<Point>& shown, const std::vector<Point>& truth) {
  std::size_t off = 0;
  std::size_t asked = 0;
  for (std::size_t k = 0; k < shown.size(); k += 11, ++asked) {
    const Point& point = shown[k];
    const bool is_near = std::any_of(truth.begin(), truth.end(), [&point](const Point& other) {
      return (point.position - other.position).norm() < static_cast<float>(kVoxelM);
    });
    off += is_near ? 0 : 1;
  }
  return static_cast<double>(off) / static_cast<double>(asked);
}

/// After a loop was closed, what is shown is the map of the corrected poses, though most of it was shown
/// before at others.
TEST(MapDisplay, FollowsTheGraph) {
  SyntheticDrive drive(1, 1.3, 4e-4);
  // As good as they are: the steps are left to the loops (OdometryCheck would correct them before).
  for (Keyframe& keyframe : drive.keyframes) keyframe.covariance = 1e-5 * Matrix6d::Identity();
  Config config;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  MapDisplay display(kVoxelM);
  MapBuilder never_moved(kVoxelM);
  for (const Keyframe& keyframe : drive.keyframes) {
    global.add(keyframe);
    display.follow(global);
    never_moved.add(keyframe.cloud.surface, global.T_map_imu(global.size() - 1));
  }
  MapBuilder corrected(kVoxelM);
  for (std::size_t k = 0; k < global.size(); ++k)
    corrected.add(global.cloud(k)->surface, global.T_map_imu(k));
  const std::vector<Point> expected = corrected.points();
  EXPECT_GT(share_off(never_moved.points(), expected), 0.1);
  EXPECT_LT(share_off(display.points(), expected), 0.001);
  EXPECT_LT(share_off(expected, display.points()), 0.001);
}

/// When the newest keyframes have been cleaned too, each voxel is shown once.
TEST(MapDisplay, ShowsNothingTwiceWhenAllIsCleaned) {
  const SyntheticDrive drive(1, 0.3, 0.0);
  Config config;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  MapDisplay display(kVoxelM);
  EXPECT_TRUE(display.points().empty());
  for (const Keyframe& keyframe : drive.keyframes) {
    global.add(keyframe);
    display.follow(global);
  }
  EXPECT_LT(global.cleaned(), global.size());
  global.finish();
  EXPECT_EQ(global.cleaned(), global.size());
  display.follow(global);
  MapBuilder all(kVoxelM);
  for (std::size_t k = 0; k < global.size(); ++k) all.add(global.cloud(k)->surface, global.T_map_imu(k));
  const std::vector<Point> expected = all.points();
  const std::vector<Point> shown = display.points();
  ASSERT_EQ(shown.size(), expected.size());
  for (std::size_t k = 0; k < shown.size(); ++k) EXPECT_EQ(shown[k].position, expected[k].position);
}

}  // namespace
}  // namespace fdi_lio::mapping
