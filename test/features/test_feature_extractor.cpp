#include <cmath>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "fdi_lio/features/feature_extractor.hpp"

namespace fdi_lio::features {
namespace {

/// One ring at height zero in a square room of half width `half`, with an optional pole in front of a wall.
/// The room is turned by `turn_rad` against the rotor.
DeskewedScan square_room(double half, bool with_pole, int points = 1800, double turn_rad = 0.0) {
  DeskewedScan scan;
  scan.ring_begin = {0, static_cast<std::uint32_t>(points)};
  for (int k = 0; k < points; ++k) {
    const double azimuth = M_PI - 2.0 * M_PI * k / points;
    const double in_room = azimuth - turn_rad;
    double range = half / std::max(std::abs(std::cos(in_room)), std::abs(std::sin(in_room)));
    if (with_pole && std::abs(azimuth - 0.2) < 0.02) range = 0.5 * half;
    Point point;
    point.position = Eigen::Vector3d(range * std::cos(azimuth), range * std::sin(azimuth), 0.0).cast<float>();
    point.time_s = static_cast<float>(k) / static_cast<float>(points) * 0.1F - 0.1F;
    scan.points.push_back(point);
  }
  return scan;
}

FeatureSet extract(const DeskewedScan& scan, const FeatureConfig& features = FeatureConfig(),
                   const degeneracy::Degeneracy& previous = degeneracy::Degeneracy()) {
  Reporter reporter;
  Config config;
  config.features = features;
  return FeatureExtractor(config, &reporter).extract(scan, previous);
}

/// The room with walls that zigzag, more and more along the ring, so that every curvature occurs.
DeskewedScan zigzag(int points = 1800) {
  DeskewedScan scan = square_room(5.0, false, points);
  for (int k = 0; k < points; ++k) {
    const float amplitude = 0.5F * static_cast<float>(k) / static_cast<float>(points);
    scan.points[static_cast<std::size_t>(k)].position *=
        1.0F + ((k / 15) % 2 == 0 ? amplitude : -amplitude) / 5.0F;
  }
  return scan;
}

TEST(FeatureExtractor, CornersAreEdgesAndWallsArePlanes) {
  const FeatureSet features = extract(square_room(5.0, false));
  std::set<int> corners;
  for (const Point& edge : features.edges) {
    const double x = edge.position.x();
    const double y = edge.position.y();
    EXPECT_NEAR(std::abs(x), 5.0, 0.2);
    EXPECT_NEAR(std::abs(y), 5.0, 0.2);
    corners.insert((x > 0 ? 1 : 0) + (y > 0 ? 2 : 0));
  }
  EXPECT_EQ(corners.size(), 4U);
  EXPECT_GT(features.planes.size(), 100U);
  for (const Point& plane : features.planes) {
    // A window that a corner takes a quarter of is not straight.
    EXPECT_LT(std::min(std::abs(plane.position.x()), std::abs(plane.position.y())), 4.95F);
  }
}

TEST(FeatureExtractor, TheWallBesideAnOcclusionIsNoFeature) {
  const FeatureSet features = extract(square_room(5.0, true));
  // The pole's shadow on the wall x = 5 lies at azimuth 0.2 +- 0.02; one window beside it is excluded.
  for (const auto* list : {&features.planes, &features.edges}) {
    for (const Point& point : *list) {
      if (point.position.x() < 4.9F) continue;
      const double azimuth = std::atan2(point.position.y(), point.position.x());
      EXPECT_FALSE(std::abs(azimuth - 0.2) < 0.02 + 4.0 * 2.0 * M_PI / 1800.0) << azimuth;
    }
  }
}

// Points of which each is the first far enough from the one before would lie 6 mm nearer than the wall on one
// side, and as much farther on the other.
TEST(FeatureExtractor, NoiseAlongTheBeamsDoesNotTurnAWall) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.02);
  double sum[2] = {0.0, 0.0};
  int count[2] = {0, 0};
  for (int scan = 0; scan < 200; ++scan) {
    DeskewedScan ring = square_room(5.0, false);
    for (Point& point : ring.points) {
      const double range = point.position.norm();
      point.position *= static_cast<float>((range + noise(random)) / range);
    }
    for (const Point& plane : extract(ring).planes) {
      if (std::abs(plane.position.x() - 5.0F) > 0.1F || std::abs(plane.position.y()) < 1.0F) continue;
      const int side = plane.position.y() < 0.0F ? 0 : 1;
      sum[side] += plane.position.x() - 5.0;
      ++count[side];
    }
  }
  ASSERT_GT(count[0], 1000);
  ASSERT_GT(count[1], 1000);
  const double turned = sum[0] / count[0] - sum[1] / count[1];
  const double sigma = 0.02 * std::sqrt(1.0 / count[0] + 1.0 / count[1]);
  EXPECT_LT(std::abs(turned), 4.0 * sigma) << turned;
}

// Counted from the first flat point behind each corner, features would lie a quarter of `plane_spacing` (62
// mm) before the middle of the wall, as seen by the rotor.
TEST(FeatureExtractor, FeaturesLieOnBothEndsOfAWallAlike) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> turn(0.0, 2.0 * M_PI);
  double sum = 0.0;
  double sum_sq = 0.0;
  constexpr int kScans = 400;
  for (int scan = 0; scan < kScans; ++scan) {
    const double turn_rad = turn(random);
    double along = 0.0;
    int count = 0;
    for (const Point& plane : extract(square_room(5.0, false, 1800, turn_rad)).planes) {
      const double in_room = std::atan2(plane.position.y(), plane.position.x()) - turn_rad;
      const double from_middle = in_room - 0.5 * M_PI * std::round(in_room / (0.5 * M_PI));
      along += 5.0 * std::tan(from_middle);
      ++count;
    }
    ASSERT_GT(count, 100);
    sum += along / count;
    sum_sq += std::pow(along / count, 2);
  }
  const double sigma = std::sqrt(sum_sq) / kScans;
  EXPECT_LT(sigma, 0.005);
  EXPECT_LT(std::abs(sum / kScans), 4.0 * sigma);
}

TEST(FeatureExtractor, QuotasSpreadFeaturesOverTheSectors) {
  FeatureConfig config;
  config.max_planes = 100;
  config.sectors = 4;
  const FeatureSet features = extract(square_room(5.0, false), config);
  int by_side[4] = {};
  for (const Point& plane : features.planes) {
    const double azimuth = std::atan2(plane.position.y(), plane.position.x());
    ++by_side[static_cast<int>((azimuth + M_PI) / (0.5 * M_PI)) % 4];
  }
  // A point on a border may count to either side.
  for (const int count : by_side) EXPECT_NEAR(count, 25, 1);
}

TEST(FeatureExtractor, ThresholdsAdmitMoreWhereTheScanBeforeWasDegraded) {
  FeatureConfig config;
  config.threshold_fdi_gain = 0.5;
  config.max_planes = config.max_edges = 100000;
  degeneracy::Degeneracy degraded;
  degraded.fdi = 1.0;
  const DeskewedScan scan = zigzag();
  const FeatureSet neutral = extract(scan, config);
  const FeatureSet more = extract(scan, config, degraded);
  EXPECT_GT(more.planes.size(), neutral.planes.size());
  EXPECT_GT(more.edges.size(), neutral.edges.size());
  // The same as thresholds that are written into the parameters.
  FeatureConfig moved = config;
  moved.edge_min_curvature *= 0.5;
  moved.plane_max_curvature *= 1.5;
  const FeatureSet expected = extract(scan, moved);
  EXPECT_EQ(more.planes.size(), expected.planes.size());
  EXPECT_EQ(more.edges.size(), expected.edges.size());
}

TEST(FeatureExtractor, ThresholdsAdmitLessWhereTheCurvatureIsUneven) {
  FeatureConfig config;
  config.threshold_complexity_gain = 0.5;
  degeneracy::Degeneracy uneven;
  uneven.metrics.curvature_complexity = 3.0;  // c = 3 / 4
  const DeskewedScan scan = zigzag();
  FeatureConfig moved = config;
  moved.edge_min_curvature *= 1.375;
  moved.plane_max_curvature *= 0.625;
  const FeatureSet less = extract(scan, config, uneven);
  const FeatureSet expected = extract(scan, moved);
  EXPECT_EQ(less.planes.size(), expected.planes.size());
  EXPECT_EQ(less.edges.size(), expected.edges.size());
  EXPECT_LT(less.planes.size(), extract(scan, config).planes.size());
}

TEST(FeatureExtractor, EmptyAndTinyScansGiveNothing) {
  EXPECT_TRUE(extract(DeskewedScan()).planes.empty());
  EXPECT_TRUE(extract(square_room(5.0, false, 5)).planes.empty());
}

}  // namespace
}  // namespace fdi_lio::features
