#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/place_descriptor.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr double kRange = 60.0;

/// Ground and some walls of random place, height and brightness, as seen from the origin.
std::vector<Point> random_place(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  std::vector<Point> points;
  const auto add = [&points](float x, float y, float z, float intensity) {
    Point point;
    point.position = Eigen::Vector3f(x, y, z);
    point.intensity = intensity;
    points.push_back(point);
  };
  for (int k = 0; k < 20000; ++k)
    add(100.0F * uniform(random) - 50.0F, 100.0F * uniform(random) - 50.0F, -1.7F, 20.0F);
  for (int wall = 0; wall < 12; ++wall) {
    const float x = 80.0F * uniform(random) - 40.0F;
    const float y = 80.0F * uniform(random) - 40.0F;
    const float heading = 6.28F * uniform(random);
    const float height = 2.0F + 8.0F * uniform(random);
    const float intensity = 10.0F + 80.0F * uniform(random);
    for (int k = 0; k < 1500; ++k) {
      const float along = 15.0F * uniform(random);
      add(x + along * std::cos(heading), y + along * std::sin(heading), -1.7F + height * uniform(random),
          intensity);
    }
  }
  return points;
}

/// The same points in the frame of a sensor at `T_place_sensor`.
std::vector<Point> seen_from(const std::vector<Point>& points, const Eigen::Isometry3d& T_place_sensor) {
  const Eigen::Isometry3f T = T_place_sensor.inverse().cast<float>();
  std::vector<Point> seen = points;
  for (Point& point : seen) point.position = T * point.position;
  return seen;
}

Eigen::Isometry3d pose(double yaw, double x, double y) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3::exp(Eigen::Vector3d(0.0, 0.0, yaw));
  T.translation() = Eigen::Vector3d(x, y, 0.0);
  return T;
}

PlaceDescriptor describe(const std::vector<Point>& points) {
  return describe_place(points, Eigen::Matrix3d::Identity(), kRange);
}

class PlaceSeenTurned : public testing::TestWithParam<double> {};

TEST_P(PlaceSeenTurned, IsRecognisedWithItsYaw) {
  const std::vector<Point> place = random_place(1);
  const PlaceDescriptor first = describe(place);
  const PlaceDescriptor second = describe(seen_from(place, pose(GetParam(), 1.0, 0.5)));
  const PlaceMatch match = compare_places(first, second);
  EXPECT_LT(match.distance, 0.25);
  EXPECT_LT(std::abs(std::remainder(match.yaw_rad - GetParam(), 2.0 * M_PI)), 0.11);
  int nearer = 0;
  for (unsigned other = 2; other < 12; ++other) {
    EXPECT_GT(compare_places(first, describe(random_place(other))).distance, match.distance + 0.1) << other;
    if (ring_key_distance(first, describe(random_place(other))) < ring_key_distance(first, second)) ++nearer;
  }
  // The key only makes a first selection.
  EXPECT_LE(nearer, 2);
}

INSTANTIATE_TEST_SUITE_P(Headings, PlaceSeenTurned, testing::Values(0.0, 0.8, -1.9, M_PI));

TEST(PlaceDescriptor, TiltIsTakenOut) {
  const std::vector<Point> place = random_place(1);
  Eigen::Isometry3d tilted = pose(0.4, 0.0, 0.0);
  tilted.rotate(so3::exp_q(Eigen::Vector3d(0.1, -0.08, 0.0)));
  const PlaceDescriptor upright = describe(place);
  const PlaceDescriptor levelled_place =
      describe_place(seen_from(place, tilted), levelled(tilted.linear()), kRange);
  EXPECT_LT(compare_places(upright, levelled_place).distance, 0.2);
}

TEST(PlaceDescriptor, IntensityGainDoesNotMatter) {
  std::vector<Point> place = random_place(1);
  const PlaceDescriptor first = describe(place);
  for (Point& point : place) point.intensity *= 3.0F;
  EXPECT_LT(compare_places(first, describe(place)).distance, 1e-3);
}

TEST(PlaceDescriptor, NoPointsAreLikeNothing) {
  EXPECT_GT(compare_places(describe({}), describe(random_place(1))).distance, 0.9);
  EXPECT_GT(compare_places(describe({}), describe({})).distance, 0.9);
}

}  // namespace
}  // namespace fdi_lio::mapping
