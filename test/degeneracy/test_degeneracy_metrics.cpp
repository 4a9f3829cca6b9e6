#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/degeneracy/metrics.hpp"

namespace fdi_lio::degeneracy {
namespace {

const double kPlaneEntropy = std::log(2.0) / std::log(3.0);

/// Unordered scan with one point per voxel of 1 m, `repeat` times each.
DeskewedScan grid_scan(int side, int repeat) {
  DeskewedScan scan;
  for (int r = 0; r < repeat; ++r) {
    for (int x = 0; x < side; ++x) {
      for (int y = 0; y < side; ++y) {
        Point point;
        point.position = Eigen::Vector3f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 0.5F);
        scan.points.push_back(point);
      }
    }
  }
  return scan;
}

/// 21 points on each axis of a cross with its middle in the middle of a voxel: `axes` 1 is a line, 3 an
/// isotropic cross.
DeskewedScan cross_scan(int axes) {
  DeskewedScan scan;
  for (int axis = 0; axis < axes; ++axis) {
    for (int k = -10; k <= 10; ++k) {
      Point point;
      point.position = Eigen::Vector3f(2.5F, 2.5F, 2.5F);
      point.position[axis] += 0.04F * static_cast<float>(k);
      scan.points.push_back(point);
    }
  }
  return scan;
}

VoxelStatistics voxels_of(const DeskewedScan& scan, const DegeneracyConfig& config = {}) {
  VoxelStatistics voxels(config);
  voxels.build(scan);
  return voxels;
}

TEST(EigenvalueEntropy, HasTheClosedFormOfLinePlaneAndBall) {
  EXPECT_DOUBLE_EQ(eigenvalue_entropy({0.0, 0.0, 2.0}), 0.0);
  EXPECT_NEAR(eigenvalue_entropy({0.0, 3.0, 3.0}), kPlaneEntropy, 1e-12);
  EXPECT_NEAR(eigenvalue_entropy({0.1, 0.1, 0.1}), 1.0, 1e-12);
  EXPECT_DOUBLE_EQ(eigenvalue_entropy({0.0, 0.0, 0.0}), 0.0);
}

TEST(LocalShapeEntropy, TellsLinePlaneAndBallApart) {
  EXPECT_NEAR(local_shape_entropy(voxels_of(cross_scan(1))), 0.0, 1e-4);
  EXPECT_NEAR(local_shape_entropy(voxels_of(cross_scan(2))), kPlaneEntropy, 1e-4);
  EXPECT_NEAR(local_shape_entropy(voxels_of(cross_scan(3))), 1.0, 1e-4);
}

TEST(OrientationEntropy, CountsTheDirectionsOfSurfaces) {
  test::Beams beams;
  beams.noise_m = 0.0;
  EXPECT_NEAR(orientation_entropy(voxels_of(test::cast(test::EmptyPlane{}, beams))), 0.0, 1e-3);
  const auto wall_only = [](const Eigen::Vector3d& d) { return 5.0 / std::max(1e-9, d.head<2>().norm()); };
  EXPECT_NEAR(orientation_entropy(voxels_of(test::cast(wall_only, beams))), kPlaneEntropy, 0.02);
  EXPECT_GT(orientation_entropy(voxels_of(test::cast(test::BoxRoom{}, beams))), 0.85);
  EXPECT_DOUBLE_EQ(orientation_entropy(voxels_of(cross_scan(1))), 0.0);
}

TEST(PointEntropy, IsOneForEvenlyFilledVoxels) {
  DegeneracyConfig config;
  config.voxel_growth_range_m = 1000.0;
  const DeskewedScan scan = grid_scan(20, 3);
  EXPECT_NEAR(point_entropy(voxels_of(scan, config), config), 1.0, 1e-12);
}

TEST(PointEntropy, IsSetAgainstTheReferenceWhenFewVoxelsAreOccupied) {
  DegeneracyConfig config;
  config.voxel_growth_range_m = 1000.0;
  const DeskewedScan scan = grid_scan(5, 1);
  EXPECT_NEAR(point_entropy(voxels_of(scan, config), config), std::log(25.0) / std::log(100.0), 1e-12);
}

TEST(PlaneDeviation, IsTheMeanDistanceToThePlane) {
  DeskewedScan scan;
  const float offset = 0.05F;
  for (int x = 0; x < 8; ++x) {
    for (int y = 0; y < 8; ++y) {
      Point point;
      const float side = (x + y) % 2 == 0 ? offset : -offset;
      point.position = Eigen::Vector3f(2.1F + 0.1F * static_cast<float>(x),
                                       2.1F + 0.1F * static_cast<float>(y), 2.5F + side);
      scan.points.push_back(point);
    }
  }
  EXPECT_NEAR(plane_deviation_m(scan, voxels_of(scan)), 0.05, 1e-3);
  for (Point& point : scan.points) point.position.z() = 2.5F;
  EXPECT_NEAR(plane_deviation_m(scan, voxels_of(scan)), 0.0, 1e-5);
}

TEST(RingCurvature, HasTheClosedFormOfStraightCornerAndSpike) {
  const Eigen::Vector3f o = Eigen::Vector3f::Zero();
  EXPECT_FLOAT_EQ(ring_curvature({-1, 0, 0}, o, {1, 0, 0}, 0.0F), 0.0F);
  EXPECT_NEAR(ring_curvature({1, 0, 0}, o, {0, 1, 0}, 0.0F), std::sqrt(0.5F), 1e-6F);
  EXPECT_FLOAT_EQ(ring_curvature({1, 0, 0}, o, {1, 0, 0}, 0.0F), 1.0F);
  EXPECT_FLOAT_EQ(ring_curvature(o, o, o, 0.1F), 0.0F);
}

TEST(CurvatureComplexity, IsZeroOnSmoothSurfacesAndGrowsWithPosts) {
  const DegeneracyConfig config;
  EXPECT_DOUBLE_EQ(curvature_complexity(test::cast(test::EmptyPlane{}), 4, 0.02, config), 0.0);
  const double room = curvature_complexity(test::cast(test::BoxRoom{}), 4, 0.02, config);
  const double posts = curvature_complexity(test::cast(test::Posts(40, 40.0, 0.3)), 4, 0.02, config);
  EXPECT_LT(room, 0.5);
  EXPECT_GT(posts, 2.0);
  EXPECT_LE(posts, 1.0 / config.curvature_floor);
}

TEST(GradientStatistics, AreInvalidWithoutAGradient) {
  EXPECT_FALSE(gradient_statistics(grid_scan(5, 1), 1, {}).valid);
  EXPECT_FALSE(gradient_statistics(DeskewedScan{}, 1, {}).valid);
}

TEST(GradientStatistics, HaveTheClosedFormOfConstantAndTwoValuedGradients) {
  DeskewedScan scan = grid_scan(10, 1);
  scan.intensity_gradient.assign(scan.points.size(), 0.5F);
  const GradientStatistics constant = gradient_statistics(scan, 1, {});
  EXPECT_TRUE(constant.valid);
  EXPECT_NEAR(constant.mean, 1.0, 1e-6);
  EXPECT_NEAR(constant.variation, 0.0, 1e-6);
  for (std::size_t i = 0; i < scan.points.size(); i += 2) scan.intensity_gradient[i] = 0.0F;
  const GradientStatistics half = gradient_statistics(scan, 1, {});
  EXPECT_NEAR(half.mean, 0.5, 1e-6);
  EXPECT_NEAR(half.variation, 1.0, 1e-6);
}

TEST(GradientStatistics, DoNotDependOnTheScaleOfRawIntensities) {
  DeskewedScan scan = grid_scan(10, 1);
  for (std::size_t i = 0; i < scan.points.size(); ++i)
    scan.intensity_gradient.push_back(i % 10 == 0 ? 0.6F : 0.1F);
  for (Point& point : scan.points) point.intensity = 0.2F;
  const GradientStatistics small = gradient_statistics(scan, 1, {});
  for (Point& point : scan.points) point.intensity = 20000.0F;
  const GradientStatistics large = gradient_statistics(scan, 1, {});
  EXPECT_NEAR(small.mean, 0.15 / 0.6, 1e-6);
  EXPECT_NEAR(small.variation, 0.15 / 0.15, 1e-6);
  EXPECT_EQ(small.mean, large.mean);
  EXPECT_EQ(small.variation, large.variation);
}

TEST(GradientStatistics, DoNotBlowUpTheNoiseOfABlankSurface) {
  const DegeneracyConfig config;
  DeskewedScan scan = grid_scan(40, 1);
  std::mt19937 random(1);
  std::normal_distribution<float> noise(20.0F, std::sqrt(0.8F * 0.8F + 1.0F));  // 4 % and one count
  const auto level = [&] { return std::log1p(noise(random) / 20.0F); };
  for (std::size_t i = 0; i < scan.points.size(); ++i) {
    const float own = level();
    float sum = 0.0F;
    for (int k = 0; k < 5; ++k) sum += std::abs(level() - own);
    scan.intensity_gradient.push_back(sum / 5.0F);
  }
  const GradientStatistics blank = gradient_statistics(scan, 1, config);
  EXPECT_GT(blank.mean, 0.05);
  EXPECT_LT(blank.mean, config.gradient_centre);
  EXPECT_LT(blank.variation, 0.6);
  scan.intensity_gradient.assign(scan.points.size(), 0.0F);
  EXPECT_DOUBLE_EQ(gradient_statistics(scan, 1, config).mean, 0.0);
  EXPECT_DOUBLE_EQ(gradient_statistics(scan, 1, config).variation, 0.0);
}

TEST(VoxelStatistics, LooksAtNoMoreThanTheWantedSamples) {
  DegeneracyConfig config;
  config.max_samples = 1000;
  const DeskewedScan scan = test::cast(test::BoxRoom{});
  const VoxelStatistics voxels = voxels_of(scan, config);
  EXPECT_LE(voxels.sample_count(), 1000U);
  EXPECT_GT(voxels.sample_count(), 900U);
  std::size_t sum = 0;
  for (const VoxelMoments& voxel : voxels.voxels()) sum += voxel.count;
  EXPECT_EQ(sum, voxels.sample_count());
}

}  // namespace
}  // namespace fdi_lio::degeneracy
