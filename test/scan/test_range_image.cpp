#include <algorithm>
#include <cmath>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
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

/// A sweep from behind by a sensor that drives 3 m forward meanwhile; the walls are at 4 to 30 m, and every
/// point is given in the frame of the end.
DeskewedScan driven_sweep() {
  constexpr int kRings = 16;
  constexpr int kColumns = 900;
  DeskewedScan scan;
  scan.duration_s = 0.1;
  scan.sweep.start = Eigen::Vector3f(-3.0F, 0.0F, 0.0F);
  scan.ring_begin.push_back(0);
  for (int ring = 0; ring < kRings; ++ring) {
    for (int column = 0; column < kColumns; ++column) {
      const float share = (static_cast<float>(column) + 0.5F) / kColumns;
      const float azimuth = static_cast<float>(M_PI) * (1.0F - 2.0F * share);
      const float elevation = 0.02F * (static_cast<float>(ring) - 7.5F);
      const float range = column % 40 < 20 ? 4.0F : 30.0F;
      Point point;
      point.position = (1.0F - share) * scan.sweep.start +
                       range * Eigen::Vector3f(std::cos(elevation) * std::cos(azimuth),
                                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      point.time_s = -0.1F * (1.0F - share);
      point.ring = static_cast<std::uint16_t>(ring);
      scan.points.push_back(point);
    }
    scan.ring_begin.push_back(static_cast<std::uint32_t>(scan.points.size()));
  }
  return scan;
}

/// Share of the points that are seen by another ring than their own.
double misplaced(const DeskewedScan& scan, const RangeImage& image) {
  std::size_t wrong = 0;
  for (const Point& point : scan.points) wrong += image.look_at(point.position).ring != point.ring ? 1 : 0;
  return static_cast<double>(wrong) / static_cast<double>(scan.points.size());
}

TEST(RangeImage, LooksFromWhereTheSensorWasInTheSweep) {
  DeskewedScan scan = driven_sweep();
  RangeImage image;
  image.build(&scan);
  EXPECT_LT(misplaced(scan, image), 0.01);
  for (std::size_t i = 0; i < scan.points.size(); i += 97) {
    const Point& point = scan.points[i];
    EXPECT_NEAR(image.look_at(point.position).range_m, i % 900 % 40 < 20 ? 4.0F : 30.0F, 0.1F) << i;
  }
  // Seen from the end of the sweep alone a ring is no cone.
  scan.sweep.start.setZero();
  image.build(&scan);
  EXPECT_GT(misplaced(scan, image), 0.1);
}

/// A sweep from behind by a sensor in a hand, which nods by 0.2 rad and rolls by 0.15 meanwhile, walls at 5
/// m.
DeskewedScan nodded_sweep() {
  const SyntheticLidar lidar;
  const auto attitude = [](float share) {
    const double turned = static_cast<double>(share) - 1.0;
    return so3::exp(turned * Eigen::Vector3d(0.15, 0.2, 0.0));
  };
  DeskewedScan scan;
  scan.duration_s = 0.1;
  for (int k = 0; k <= Sweep::kSteps; ++k) {
    const float share = static_cast<float>(k) / Sweep::kSteps;
    scan.sweep.axes[static_cast<std::size_t>(k)] = attitude(share).col(2).cast<float>();
  }
  scan.ring_begin.push_back(0);
  for (int ring = 0; ring < lidar.rings; ++ring) {
    for (int column = 0; column < lidar.columns; ++column) {
      const float share = (static_cast<float>(column) + 0.5F) / static_cast<float>(lidar.columns);
      Point point;
      point.position = (5.0 * attitude(share) * lidar.direction(ring, column)).cast<float>();
      point.time_s = -0.1F * (1.0F - share);
      point.ring = static_cast<std::uint16_t>(ring);
      scan.points.push_back(point);
    }
    scan.ring_begin.push_back(static_cast<std::uint32_t>(scan.points.size()));
  }
  return scan;
}

TEST(RangeImage, KnowsHowTheSensorNodsInTheSweep) {
  DeskewedScan scan = nodded_sweep();
  RangeImage image;
  image.build(&scan);
  EXPECT_LT(misplaced(scan, image), 0.02);
  // About the axis at the end of the sweep alone a ring is no cone.
  scan.sweep = Sweep();
  image.build(&scan);
  EXPECT_GT(misplaced(scan, image), 0.5);
}

TEST(RangeImage, KnowsTheBeamsOfALidarThatDrivesOrNodsInTheSweep) {
  for (DeskewedScan scan : {driven_sweep(), nodded_sweep()}) {
    RangeImage image;
    image.build(&scan);
    int asked = 0;
    for (std::size_t i = 0; i < scan.points.size(); i += 97) {
      RangeImage::Directions one;
      one.set(0, scan.points[i].position);
      image.look_at(Eigen::Isometry3f::Identity(), &one);
      if (one.ring[0] != scan.points[i].ring) continue;
      const Eigen::Vector3f seen(one.x[0], one.y[0], one.z[0]);
      EXPECT_LT((image.beam_towards(one.ring[0], one.column[0], seen) - seen.normalized()).norm(), 5e-3F)
          << i;
      ++asked;
    }
    EXPECT_GT(asked, 50);
  }
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

TEST(RangeImage, KnowsTheBeamThatPassesAboveAPoint) {
  LabelledScan labelled = hall_scan();
  RangeImage image;
  image.build(&labelled.scan);
  int asked = 0;
  for (std::size_t i = 0; i < labelled.scan.points.size(); i += 101) {
    const Eigen::Vector3f p = labelled.scan.points[i].position;
    const float range = p.norm();
    const float level = p.head<2>().norm();
    for (const float below_m : {0.0F, 0.02F, 0.05F}) {
      const float elevation = std::atan2(p.z(), level) - below_m / range;
      const Eigen::Vector3f below =
          range * Eigen::Vector3f(std::cos(elevation) * p.x() / level, std::cos(elevation) * p.y() / level,
                                  std::sin(elevation));
      const RangeImage::Direction direction = image.look_at(below);
      if (direction.ring != labelled.scan.points[i].ring) continue;
      const Eigen::Vector3f beam = image.beam_towards(direction.ring, direction.column, below);
      EXPECT_NEAR(beam.norm(), 1.0F, 1e-5F);
      EXPECT_LT((range * beam - p).norm(), 2e-3F) << i;
      ++asked;
    }
  }
  EXPECT_GT(asked, 300);
}

TEST(RangeImage, ARingSawFartherWhateverItsNeighboursSaw) {
  LabelledScan labelled = hall_scan();
  RangeImage image;
  image.build(&labelled.scan);
  int alone = 0;
  for (int ring = 0; ring < image.rings(); ++ring) {
    for (int column = 1; column + 1 < image.columns(); column += 7) {
      const float range = 0.97F * image.range_at(ring, column);
      int filled = 0;
      bool all_farther = true;
      for (int c = column - 1; c <= column + 1; ++c) {
        const float seen = image.range_at(ring, c);
        if (seen > 0.0F) ++filled;
        all_farther = all_farther && (seen <= 0.0F || seen > range);
      }
      EXPECT_EQ(image.ring_saw_farther(ring, column, range), all_farther && filled >= 2);
      if (image.ring_saw_farther(ring, column, range) && !image.saw_farther(ring, column, range)) ++alone;
    }
  }
  EXPECT_GT(alone, 50);
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
