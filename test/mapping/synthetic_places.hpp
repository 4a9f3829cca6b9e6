#pragma once

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"

/// Point clouds of made-up places, for the tests of loops.
namespace fdi_lio::mapping {

inline Eigen::Isometry3d planar_pose(double x, double y, double yaw) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3::exp(Eigen::Vector3d(0.0, 0.0, yaw));
  T.translation() = Eigen::Vector3d(x, y, 0.0);
  return T;
}

/// Surfaces on which random points lie, brighter or darker.
class SyntheticWorld {
 public:
  /// Another `spots` puts the points elsewhere on the same surfaces.
  explicit SyntheticWorld(unsigned spots = 1) : random_(spots) {}

  /// A rectangle: `corner`, two sides, its brightness, and points per square metre.
  void add(const Eigen::Vector3d& corner, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
           double intensity, double density = 3.0) {
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    const auto count = static_cast<int>(density * a.cross(b).norm());
    for (int k = 0; k < count; ++k)
      samples_.push_back({corner + uniform(random_) * a + uniform(random_) * b, intensity});
  }

  void add_ground(double half_m) {
    add({-half_m, -half_m, -1.7}, {2.0 * half_m, 0.0, 0.0}, {0.0, 2.0 * half_m, 0.0}, 10.0, 1.0);
  }

  /// An upright box, seen from outside.
  void add_box(double x, double y, double width, double depth, double height, double intensity,
               double density = 3.0) {
    const Eigen::Vector3d up(0.0, 0.0, height);
    add({x, y, -1.7}, {width, 0.0, 0.0}, up, intensity, density);
    add({x, y + depth, -1.7}, {width, 0.0, 0.0}, up, intensity, density);
    add({x, y, -1.7}, {0.0, depth, 0.0}, up, intensity, density);
    add({x + width, y, -1.7}, {0.0, depth, 0.0}, up, intensity, density);
  }

  /// What a sensor at `T` sees within 30 m: every second point or so, with 1 cm of noise, all of them plane
  /// features.
  KeyframeCloud seen_from(const Eigen::Isometry3d& T, unsigned seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, 0.01);
    const Eigen::Isometry3d T_imu_world = T.inverse();
    KeyframeCloud cloud;
    for (const Sample& sample : samples_) {
      if ((sample.position - T.translation()).norm() > 30.0 || random() % 2 == 0) continue;
      const Eigen::Vector3d error(noise(random), noise(random), noise(random));
      Point point;
      point.position = (T_imu_world * (sample.position + error)).cast<float>();
      point.intensity = static_cast<float>(sample.intensity);
      cloud.planes.push_back(point);
    }
    cloud.surface = cloud.planes;
    return cloud;
  }

 private:
  struct Sample {
    Eigen::Vector3d position;
    double intensity;
  };
  std::vector<Sample> samples_;
  std::mt19937 random_;
};

/// Boxes of random size strewn over a square, a strip about the lines |x| = 25 and |y| = 25 left free.
inline SyntheticWorld make_town(unsigned seed, double half_m = 45.0) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  SyntheticWorld world;
  world.add_ground(half_m);
  const auto near_street = [](double low, double high) {
    return (low < 28.0 && high > 22.0) || (low < -22.0 && high > -28.0);
  };
  for (int k = 0; k < 220; ++k) {
    const double x = (2.0 * uniform(random) - 1.0) * half_m;
    const double y = (2.0 * uniform(random) - 1.0) * half_m;
    const double width = 1.0 + 6.0 * uniform(random);
    const double depth = 1.0 + 6.0 * uniform(random);
    if (near_street(x, x + width) || near_street(y, y + depth)) continue;
    world.add_box(x, y, width, depth, 2.0 + 6.0 * uniform(random), 20.0 + 200.0 * uniform(random));
  }
  return world;
}

}  // namespace fdi_lio::mapping
