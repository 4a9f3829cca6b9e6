#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/scan/isolated_points.hpp"
#include "fdi_lio/scan/point_removal.hpp"

namespace fdi_lio::scan {
namespace {

/// The hall, and how its air scatters.
struct DustyScan {
  DeskewedScan scan;
  std::vector<bool> is_dust;
};

/// A beam meets dust after an exponentially distributed way, `per_m` of it on each metre.
DustyScan dusty_hall(double per_m) {
  SyntheticLidar lidar;
  lidar.columns = 1800;
  DustyScan dusty;
  dusty.scan = cast(lidar, hall(), pose_at(1.0, 2.0, 0.4), to_nanoseconds(100.0), marble).scan;
  std::mt19937 random(7);
  std::exponential_distribution<float> free_way(static_cast<float>(per_m));
  for (Point& point : dusty.scan.points) {
    const float range = point.position.norm();
    const float way = free_way(random);
    dusty.is_dust.push_back(way < range);
    if (way < range) point.position *= std::max(way, 0.5F) / range;
  }
  return dusty;
}

/// Shares of the dust that was found and of the surfaces that were not.
std::pair<double, double> found_and_kept(const DustyScan& dusty, const std::vector<RemovalReason>& reasons) {
  double dust = 0.0;
  double found = 0.0;
  double kept = 0.0;
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    const bool is_isolated = reasons[i] == RemovalReason::kIsolated;
    if (dusty.is_dust[i]) {
      ++dust;
      found += is_isolated ? 1.0 : 0.0;
    } else {
      kept += is_isolated ? 0.0 : 1.0;
    }
  }
  return {found / dust, kept / (static_cast<double>(reasons.size()) - dust)};
}

TEST(IsolatedPoints, AreThoseWithFewPointsAboutThem) {
  DustyScan dusty = dusty_hall(0.01);
  const DeskewedScan& scan = dusty.scan;
  RangeImage image;
  image.build(&dusty.scan);
  IsolationConfig config;
  config.min_neighbours = 3;
  const std::vector<RemovalReason> reasons = find_isolated(scan, image, config);
  ASSERT_EQ(reasons.size(), scan.points.size());
  // All points of the rings about it, each seen in its cell.
  for (std::size_t i = 0; i < scan.points.size(); i += 13) {
    const Point& point = scan.points[i];
    const double spacing = 2.0 * M_PI * point.position.norm() / image.columns();
    const double reach = config.reach_m + config.reach_columns * spacing;
    int near = 0;
    const int ring = point.ring;
    const std::uint32_t begin = scan.ring_begin[static_cast<std::size_t>(std::max(0, ring - 1))];
    const std::uint32_t end = scan.ring_begin[static_cast<std::size_t>(std::min(image.rings(), ring + 2))];
    for (std::uint32_t j = begin; j < end; ++j) {
      const Point& other = scan.points[j];
      const int aside = std::abs(other.column - point.column);
      if (std::min(aside, image.columns() - aside) > 2 || image.at(other.ring, other.column) != j) continue;
      if (other.ring == point.ring && other.column == point.column) continue;
      if ((other.position - point.position).norm() <= reach) ++near;
    }
    EXPECT_EQ(reasons[i] == RemovalReason::kIsolated, near < 3) << i;
  }
}

TEST(IsolatedPoints, DustIsFoundAndSurfacesStay) {
  for (const double per_m : {0.002, 0.01, 0.03}) {
    DustyScan dusty = dusty_hall(per_m);
    RangeImage image;
    image.build(&dusty.scan);
    const auto [found, kept] = found_and_kept(dusty, find_isolated(dusty.scan, image, IsolationConfig()));
    EXPECT_GT(found, 0.8) << per_m;
    EXPECT_GT(kept, 1.0 - 0.5 * per_m) << per_m;
  }
}

TEST(IsolatedPoints, CleanAirHasNone) {
  DustyScan clean = dusty_hall(1e-9);
  RangeImage image;
  image.build(&clean.scan);
  const std::vector<RemovalReason> reasons = find_isolated(clean.scan, image, IsolationConfig());
  EXPECT_EQ(std::count(reasons.begin(), reasons.end(), RemovalReason::kIsolated), 0);
}

TEST(IsolatedPoints, CanBeLeftInTheScan) {
  DustyScan dusty = dusty_hall(0.01);
  RangeImage image;
  image.build(&dusty.scan);
  IsolationConfig config;
  config.min_neighbours = 0;
  EXPECT_TRUE(find_isolated(dusty.scan, image, config).empty());
}

TEST(IsolatedPoints, TheImageFollowsTheirRemoval) {
  DustyScan dusty = dusty_hall(0.01);
  RangeImage image;
  image.build(&dusty.scan);
  const DeskewedScan before = dusty.scan;
  const std::vector<RemovalReason> reasons = find_isolated(dusty.scan, image, IsolationConfig());
  image.remove(reasons);
  remove_points(reasons, &dusty.scan);
  const DeskewedScan& scan = dusty.scan;
  ASSERT_GT(scan.removed.size(), 0U);
  EXPECT_EQ(scan.points.size() + scan.removed.size(), before.points.size());
  EXPECT_EQ(scan.moving_count(), 0U);
  std::size_t seen = 0;
  for (int ring = 0; ring < image.rings(); ++ring) {
    for (int column = 0; column < image.columns(); ++column) {
      const std::uint32_t i = image.at(ring, column);
      if (i == RangeImage::kNone) {
        EXPECT_EQ(image.range_at(ring, column), 0.0F);
        continue;
      }
      ASSERT_LT(i, scan.points.size());
      EXPECT_EQ(scan.points[i].ring, ring);
      EXPECT_EQ(scan.points[i].column, column);
      EXPECT_FLOAT_EQ(image.range_at(ring, column), scan.points[i].position.norm());
      ++seen;
    }
  }
  EXPECT_GT(seen, scan.points.size() * 95 / 100);
}

}  // namespace
}  // namespace fdi_lio::scan
