#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/odometry/beam_correction.hpp"

namespace fdi_lio::odometry {
namespace {

constexpr int kRings = 16;
constexpr double kRangeError = 0.03;
constexpr int kWrongRing = 5;

/// Level ground and four walls, seen from the middle, with the range of one ring too long.
class Arena {
 public:
  FeatureSet scan(double height_m, double speed_mps) {
    FeatureSet features;
    for (int ring = 0; ring < kRings; ++ring) {
      const double elevation = (-15.0 + 2.0 * ring) * M_PI / 180.0;
      for (int k = 0; k < 180; ++k) {
        const double azimuth = 2.0 * M_PI * k / 180.0 + 0.01 * noise_(generator_);
        const Eigen::Vector3d d(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
        const double to_wall = 15.0 / std::max(std::abs(d.x()), std::abs(d.y()));
        const double to_ground = d.z() < 0.0 ? -height_m / d.z() : 1e9;
        const double range = std::min(to_wall, to_ground) + (ring == kWrongRing ? kRangeError : 0.0) +
                             0.005 * noise_(generator_);
        Point point;
        point.time_s = -0.1F * static_cast<float>(k) / 180.0F;
        // Deskewed: the point relative to where the sensor is at the scan's stamp.
        point.position =
            (range * d + Eigen::Vector3d(speed_mps * static_cast<double>(point.time_s), 0.0, 0.0))
                .cast<float>();
        point.ring = static_cast<std::uint16_t>(ring);
        features.planes.push_back(point);
      }
    }
    return features;
  }

 private:
  std::mt19937 generator_{3};
  std::normal_distribution<double> noise_{0.0, 1.0};
};

TEST(BeamCorrection, TakesOutTheErrorOfOneRing) {
  Arena arena;
  BeamCorrection correction{Config()};
  matching::VoxelMap map{matching::VoxelMapConfig()};
  for (int k = 0; k < 100; ++k) {
    // Up and down, so that the surfaces are seen by one ring after the other.
    imu::NavState state;
    state.t_odom_imu.z() = 2.0 + std::sin(0.37 * k);
    const FeatureSet corrected = correction.apply(arena.scan(state.t_odom_imu.z(), 0.0), state);
    correction.learn(corrected, state, map);
    std::vector<Eigen::Vector3d> points;
    for (const Point& point : corrected.planes)
      points.push_back(state.T_odom_imu() * point.position.cast<double>());
    map.insert(points, std::vector<float>(points.size(), 0.0F), state.T_odom_imu());
  }
  imu::NavState moving;
  moving.v_odom.x() = 5.0;
  const FeatureSet measured = arena.scan(2.0, 5.0);
  const FeatureSet corrected = correction.apply(measured, moving);
  double shift_sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < measured.planes.size(); ++i) {
    const Point& point = measured.planes[i];
    if (point.ring != kWrongRing) continue;
    const Eigen::Vector3f fired_at(5.0F * point.time_s, 0.0F, 0.0F);
    const Eigen::Vector3f shift = corrected.planes[i].position - point.position;
    shift_sum += shift.dot((point.position - fired_at).normalized());
    ++count;
  }
  ASSERT_GT(count, 0);
  // Part of it is a parabola over the rings, which stays.
  EXPECT_LT(shift_sum / count, -0.5 * kRangeError);
  EXPECT_GT(shift_sum / count, -1.2 * kRangeError);
}

TEST(BeamCorrection, ChangesNothingBeforeItHasLearned) {
  Arena arena;
  const FeatureSet measured = arena.scan(2.0, 0.0);
  const FeatureSet corrected = BeamCorrection(Config()).apply(measured, imu::NavState());
  ASSERT_EQ(corrected.planes.size(), measured.planes.size());
  for (std::size_t i = 0; i < measured.planes.size(); ++i)
    EXPECT_EQ(corrected.planes[i].position, measured.planes[i].position);
}

}  // namespace
}  // namespace fdi_lio::odometry
