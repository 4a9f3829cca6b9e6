#include <algorithm>
#include <cmath>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/scan/range_image.hpp"

namespace fdi_lio::scan {
namespace {

double grey(const Eigen::Vector3d&) { return 1.0; }

LabelledScan hall_scan(const SyntheticLidar& lidar = SyntheticLidar()) {
  return cast(lidar, hall(), pose_at(1.0, 2.0, 0.4), to_nanoseconds(100.0), grey);
}

TEST(FastAtan2, IsWithinATenThousandthOfADegree) {
  double worst = 0.0;
  for (int k = 0; k < 200000; ++k) {
    const double angle = -M_PI + 2.0 * M_PI * (k + 0.5) / 200000.0;
    for (const double length : {1e-3, 1.0, 200.0}) {
      const auto y = static_cast<float>(length * std::sin(angle));
      const auto x = static_cast<float>(length * std::cos(angle));
      worst = std::max(worst, std::abs(static_cast<double>(fast_atan2(y, x)) -
                                       std::atan2(static_cast<double>(y), static_cast<double>(x))));
    }
  }
  EXPECT_LT(worst, 1e-5);
}

TEST(FastAtan2, HasNoSurprisesOnTheAxes) {
  EXPECT_EQ(fast_atan2(0.0F, 0.0F), 0.0F);
  EXPECT_EQ(fast_atan2(0.0F, 1.0F), 0.0F);
  EXPECT_NEAR(fast_atan2(1.0F, 0.0F), M_PI / 2.0, 1e-6);
  EXPECT_NEAR(fast_atan2(-1.0F, 0.0F), -M_PI / 2.0, 1e-6);
  EXPECT_NEAR(fast_atan2(0.0F, -1.0F), M_PI, 1e-6);
}

TEST(RangeImage, FindsTheNumberOfColumns) {
  for (const int columns : {360, 900, 1800, 2048}) {
    SyntheticLidar lidar;
    lidar.columns = columns;
    LabelledScan labelled = hall_scan(lidar);
    RangeImage image;
    image.build(&labelled.scan);
    EXPECT_NEAR(image.columns(), columns, 0.01 * columns);
    EXPECT_EQ(image.rings(), lidar.rings);
  }
}

TEST(RangeImage, KeepsItsColumnsWhileTheyFit) {
  LabelledScan first = hall_scan();
  RangeImage image;
  image.build(&first.scan);
  const int columns = image.columns();
  SyntheticLidar little_different;
  little_different.columns = 960;
  LabelledScan second = hall_scan(little_different);
  image.build(&second.scan);
  EXPECT_EQ(image.columns(), columns);
  SyntheticLidar other;
  other.columns = 1800;
  LabelledScan third = hall_scan(other);
  image.build(&third.scan);
  EXPECT_NEAR(image.columns(), 1800, 18);
}

TEST(RangeImage, EveryPointIsSeenInItsOwnCell) {
  LabelledScan labelled = hall_scan();
  const DeskewedScan& scan = labelled.scan;
  RangeImage image;
  image.build(&labelled.scan);
  std::size_t hidden = 0;
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const Point& point = scan.points[i];
    const RangeImage::Direction direction = image.look_at(point.position);
    ASSERT_TRUE(direction.is_inside) << i;
    ASSERT_EQ(direction.ring, point.ring);
    ASSERT_EQ(direction.column, point.column);
    ASSERT_FLOAT_EQ(direction.range_m, point.position.norm());
    const std::uint32_t in_cell = image.at(point.ring, point.column);
    ASSERT_NE(in_cell, RangeImage::kNone);
    ASSERT_LE(image.range_at(point.ring, point.column), direction.range_m);
    if (in_cell != i) ++hidden;
  }
  // Two points share a cell now and then, as the columns are not aligned with the beams.
  EXPECT_LT(hidden, scan.points.size() / 50);
}

TEST(RangeImage, LooksAtManyMovedPointsAtOnce) {
  LabelledScan labelled = hall_scan();
  RangeImage image;
  image.build(&labelled.scan);
  const Eigen::Isometry3f T = pose_at(0.3, -0.2, 0.7).cast<float>();
  RangeImage::Directions many;
  int inside = 0;
  for (int k = 0; k < RangeImage::Directions::kSize; ++k)
    many.set(
        k,
        labelled.scan
            .points[labelled.scan.points.size() / RangeImage::Directions::kSize * static_cast<std::size_t>(k)]
            .position);
  const RangeImage::Directions before = many;
  image.look_at(T, &many);
  for (int k = 0; k < RangeImage::Directions::kSize; ++k) {
    const Eigen::Vector3f p = T * Eigen::Vector3f(before.x[k], before.y[k], before.z[k]);
    const double azimuth = std::atan2(static_cast<double>(p.y()), static_cast<double>(p.x()));
    EXPECT_NEAR(many.column[k], (M_PI - azimuth) / (2.0 * M_PI) * image.columns() - 0.5, 0.51);
    EXPECT_NEAR(many.range_m[k], p.norm(), 1e-5F * p.norm());
    const RangeImage::Direction alone = image.look_at(p);
    EXPECT_EQ(alone.is_inside, many.ring[k] >= 0);
    if (!alone.is_inside) continue;
    EXPECT_EQ(alone.ring, many.ring[k]);
    EXPECT_NEAR(alone.column, many.column[k], 1);
    ++inside;
  }
  EXPECT_GT(inside, RangeImage::Directions::kSize / 2);
}

TEST(RangeImage, ACellHoldsItsNearestPointAndColumnsWrap) {
  LabelledScan labelled = hall_scan();
  RangeImage image;
  image.build(&labelled.scan);
  const std::size_t begin = labelled.scan.ring_begin[10];
  Point nearer = labelled.scan.points[begin];
  nearer.position *= 0.5F;
  labelled.scan.points.insert(labelled.scan.points.begin() + static_cast<std::ptrdiff_t>(begin) + 1, nearer);
  for (std::size_t ring = 11; ring < labelled.scan.ring_begin.size(); ++ring)
    ++labelled.scan.ring_begin[ring];
  image.build(&labelled.scan);
  const int column = labelled.scan.points[begin].column;
  EXPECT_EQ(image.at(10, column), begin + 1);
  EXPECT_FLOAT_EQ(image.range_at(10, column), nearer.position.norm());
  EXPECT_EQ(image.at(10, -1), image.at(10, image.columns() - 1));
  EXPECT_EQ(image.at(10, image.columns() + 2), image.at(10, 2));
}

TEST(RangeImage, LooksNowhereAboveAndBelowTheBeams) {
  LabelledScan labelled = hall_scan();
  RangeImage image;
  EXPECT_FALSE(image.look_at(Eigen::Vector3f(1.0F, 0.0F, 0.0F)).is_inside);
  image.build(&labelled.scan);
  EXPECT_TRUE(image.look_at(Eigen::Vector3f(5.0F, 1.0F, 0.0F)).is_inside);
  EXPECT_FALSE(image.look_at(Eigen::Vector3f(1.0F, 0.0F, 1.0F)).is_inside);
  EXPECT_FALSE(image.look_at(Eigen::Vector3f(1.0F, 0.0F, -1.0F)).is_inside);
  EXPECT_FALSE(image.look_at(Eigen::Vector3f::Zero()).is_inside);
}

TEST(RangeImage, EmptyScanIsEmpty) {
  DeskewedScan scan;
  RangeImage image;
  image.build(&scan);
  EXPECT_TRUE(image.empty());
  EXPECT_EQ(image.rings(), 0);
  scan.ring_begin.assign(17, 0);  // rings without a point
  image.build(&scan);
  EXPECT_EQ(image.rings(), 16);
  EXPECT_EQ(image.at(3, 7), RangeImage::kNone);
  EXPECT_FALSE(image.look_at(Eigen::Vector3f(1.0F, 0.0F, 0.0F)).is_inside);
}

}  // namespace
}  // namespace fdi_lio::scan
