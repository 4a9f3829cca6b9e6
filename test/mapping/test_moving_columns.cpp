#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/moving_columns.hpp"

namespace fdi_lio::mapping {
namespace {

Point point_at(const Eigen::Vector3d& position) {
  Point point;
  point.position = position.cast<float>();
  return point;
}

/// A scan of a tilted lidar that lost a body from 0.4 to 1.6 m of height at (5, 2) as `reason`.
class Columns : public testing::Test {
 protected:
  const Eigen::Matrix3d R_level_lidar_ = so3::exp(Eigen::Vector3d(0.3, -0.2, 0.7));

  Eigen::Vector3f seen(double x, double y, double height) const {
    return (R_level_lidar_.transpose() * Eigen::Vector3d(x, y, height)).cast<float>();
  }

  MovingColumns columns(RemovalReason reason) const {
    DeskewedScan scan;
    for (double height = 0.4; height < 1.65; height += 0.1) {
      scan.removed.push_back(point_at(seen(5.0, 2.0, height).cast<double>()));
      scan.removal_reasons.push_back(reason);
    }
    return {scan, R_level_lidar_};
  }
};

TEST_F(Columns, HoldFeetAndHeadOfWhatMoves) {
  for (const RemovalReason reason : {RemovalReason::kFreeSpace, RemovalReason::kPartOfObject}) {
    const MovingColumns moving = columns(reason);
    EXPECT_TRUE(moving.hold(seen(5.0, 2.0, 0.02)));
    EXPECT_TRUE(moving.hold(seen(5.2, 1.8, 1.0)));
    EXPECT_TRUE(moving.hold(seen(5.0, 2.0, 1.75)));
  }
}

TEST_F(Columns, LeaveWhatIsBesideAndFarAboveOrBelow) {
  const MovingColumns moving = columns(RemovalReason::kFreeSpace);
  EXPECT_FALSE(moving.hold(seen(5.6, 2.0, 1.0)));
  EXPECT_FALSE(moving.hold(seen(5.0, 1.4, 1.0)));
  EXPECT_FALSE(moving.hold(seen(5.0, 2.0, 2.2)));
  EXPECT_FALSE(moving.hold(seen(5.0, 2.0, -0.3)));
}

TEST_F(Columns, DustThatWasRemovedHasNone) {
  EXPECT_FALSE(columns(RemovalReason::kIsolated).hold(seen(5.0, 2.0, 1.0)));
}

TEST_F(Columns, TakeFromTheCloudWhatTheyHold) {
  std::vector<Point> points = {point_at(seen(5.0, 2.0, 0.05).cast<double>()),
                               point_at(seen(7.0, 2.0, 0.05).cast<double>())};
  points[1].intensity = 3.0F;
  const std::vector<Point> left = columns(RemovalReason::kFreeSpace).without(points);
  ASSERT_EQ(left.size(), 1U);
  EXPECT_EQ(left[0].intensity, 3.0F);
  EXPECT_EQ(columns(RemovalReason::kIsolated).without(points).size(), 2U);
}

}  // namespace
}  // namespace fdi_lio::mapping
