#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/localisation/brightness_match.hpp"

namespace fdi_lio::localisation {
namespace {

constexpr double kVoxelM = 0.2;
constexpr double kFarM = 100.0;

/// A wall of 8 m x 3 m in the plane y = 2 with boards of 1 m that are `contrast` brighter, one each 3 m
/// along x, and a tone of its own every half metre, drawn from `seed`.
std::vector<mapping::PlacedCloud> wall(std::uint32_t seed, float contrast) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> tone(-0.5F * contrast, 0.5F * contrast);
  std::vector<float> tones(1000);
  for (float& each : tones) each = tone(random);
  auto cloud = std::make_shared<mapping::KeyframeCloud>();
  for (int i = 0; i < 80; ++i) {
    for (int k = 0; k < 30; ++k) {
      Point point;
      point.position =
          Eigen::Vector3f(0.05F + 0.1F * static_cast<float>(i), 2.0F, 0.05F + 0.1F * static_cast<float>(k));
      const bool is_board = i % 30 < 10;
      point.intensity =
          20.0F + (is_board ? contrast : 0.0F) + tones[static_cast<std::size_t>(i / 5 * 7 + k / 5)];
      cloud->surface.push_back(point);
    }
  }
  return {{cloud, Eigen::Isometry3d::Identity()}};
}

Eigen::Isometry3d shifted(double x_m) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = x_m;
  return T;
}

TEST(BrightnessMatch, TheSamePlaceIsExplained) {
  const BrightnessMatch match =
      match_brightness(wall(1, 10.0F), wall(1, 10.0F), shifted(0.0), kVoxelM, kFarM);
  EXPECT_EQ(match.voxels, 40U * 15U);
  EXPECT_NEAR(match.correlation, 1.0, 1e-9);
}

/// Gain and scale of the sensor do not count.
TEST(BrightnessMatch, AnotherGainIsTheSamePlace) {
  const std::vector<mapping::PlacedCloud> target = wall(1, 10.0F);
  auto cloud = std::make_shared<mapping::KeyframeCloud>(*target[0].cloud);
  for (Point& point : cloud->surface) point.intensity = 3.0F * point.intensity + 2.0F;  // 1 + I times 3
  const BrightnessMatch match =
      match_brightness(target, {{cloud, Eigen::Isometry3d::Identity()}}, shifted(0.0), kVoxelM, kFarM);
  EXPECT_NEAR(match.correlation, 1.0, 1e-6);
}

/// Equal boards, but other tones: explained in part. Boards where there are none: not at all.
TEST(BrightnessMatch, ARepetitionIsExplainedInPart) {
  const double repeated =
      match_brightness(wall(1, 10.0F), wall(2, 10.0F), shifted(3.0), kVoxelM, kFarM).correlation;
  EXPECT_GT(repeated, 0.4);
  EXPECT_LT(repeated, 0.95);
  EXPECT_LT(match_brightness(wall(1, 10.0F), wall(2, 10.0F), shifted(1.5), kVoxelM, kFarM).correlation, 0.0);
}

TEST(BrightnessMatch, NothingDisagreesWithoutContrastOrNeighbours) {
  EXPECT_DOUBLE_EQ(match_brightness(wall(1, 0.0F), wall(1, 10.0F), shifted(0.0), kVoxelM, kFarM).correlation,
                   1.0);
  const BrightnessMatch far = match_brightness(wall(1, 10.0F), wall(1, 10.0F), shifted(50.0), kVoxelM, kFarM);
  EXPECT_EQ(far.voxels, 0U);
  EXPECT_DOUBLE_EQ(far.correlation, 1.0);
  EXPECT_EQ(match_brightness({}, {}, shifted(0.0), kVoxelM, kFarM).voxels, 0U);
}

TEST(BrightnessMatch, LooksNoFartherThanTheRadius) {
  const BrightnessMatch match = match_brightness(wall(1, 10.0F), wall(1, 10.0F), shifted(0.0), kVoxelM, 3.0);
  std::size_t near = 0;
  for (int i = 0; i < 40; ++i)
    for (int k = 0; k < 15; ++k)
      near += Eigen::Vector3d(0.1 + 0.2 * i, 2.0, 0.1 + 0.2 * k).norm() <= 3.0 ? 1U : 0U;
  EXPECT_NEAR(static_cast<double>(match.voxels), static_cast<double>(near), 2.0);
}

/// Against a search through all pairs of points that lie one in a voxel, at an arbitrary pose.
TEST(BrightnessMatch, AgreesWithTheSearchThroughAllPairs) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> cell(-15, 15);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  auto target = std::make_shared<mapping::KeyframeCloud>();
  for (int k = 0; k < 4000; ++k) {
    Point point;
    point.position = Eigen::Vector3f(0.2F * static_cast<float>(cell(random)) + 0.1F,
                                     0.2F * static_cast<float>(cell(random)) + 0.1F,
                                     0.2F * static_cast<float>(cell(random)) + 0.1F);
    const bool is_taken =
        std::any_of(target->surface.begin(), target->surface.end(),
                    [&](const Point& other) { return (other.position - point.position).norm() < 0.01F; });
    point.intensity = 50.0F * unit(random);
    if (!is_taken) target->surface.push_back(point);
  }
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3::exp(Eigen::Vector3d(0.2, -0.1, 0.9));
  T.translation() = Eigen::Vector3d(0.31, -0.72, 0.13);
  // In the frame of the source, with a displacement that tells the nearest from the others.
  auto source = std::make_shared<mapping::KeyframeCloud>();
  for (std::size_t k = 0; k < target->surface.size(); k += 3) {
    Point point = target->surface[k];
    const Eigen::Vector3f moved_by(0.04F * (unit(random) - 0.5F), 0.04F * (unit(random) - 0.5F), 0.03F);
    point.position = (T.inverse() * (point.position + moved_by).cast<double>()).cast<float>();
    point.intensity *= 0.5F + unit(random);
    source->surface.push_back(point);
  }
  double n = 0.0, a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
  for (const Point& point : source->surface) {
    const Eigen::Vector3f p = (T * point.position.cast<double>()).cast<float>();
    const Point* nearest = nullptr;
    for (const Point& other : target->surface)
      if (nearest == nullptr || (other.position - p).norm() < (nearest->position - p).norm())
        nearest = &other;
    ASSERT_LT((nearest->position - p).norm(), 0.1F);
    const double x = std::log1p(point.intensity), y = std::log1p(nearest->intensity);
    n += 1.0, a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
  }
  const double expected = (n * ab - a * b) / std::sqrt((n * aa - a * a) * (n * bb - b * b));
  const BrightnessMatch match =
      match_brightness({{target, Eigen::Isometry3d::Identity()}}, {{source, Eigen::Isometry3d::Identity()}},
                       T, kVoxelM, kFarM);
  EXPECT_EQ(match.voxels, source->surface.size());
  EXPECT_NEAR(match.correlation, expected, 1e-6);
}

}  // namespace
}  // namespace fdi_lio::localisation
