#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/mapping/estimator.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr double kPeriod_s = 0.1;

/// A street whose fronts across the way all stand ahead to the left, where the sweep begins.
class Street {
 public:
  /// What is seen from x = `speed` t of the sweep that ends at `end_s`, deskewed with `v_deskew` along x.
  FeatureSet scan(double end_s, double speed_mps, double v_deskew_mps, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::normal_distribution<double> noise(0.0, 0.01);
    FeatureSet features;
    features.stamp = static_cast<Stamp>(std::llround(1e9 * end_s));
    const auto add = [&](const Eigen::Vector3d& place) {
      // The sweep begins ahead and goes round to the left.
      const Eigen::Vector3d from_end(place.x() - speed_mps * end_s, place.y(), place.z());
      double azimuth = std::atan2(from_end.y(), from_end.x());
      if (azimuth < 0.0) azimuth += 2.0 * M_PI;
      Point point;
      point.time_s = static_cast<float>(kPeriod_s * (azimuth / (2.0 * M_PI) - 1.0));
      const Eigen::Vector3d error(noise(random), noise(random), noise(random));
      Eigen::Vector3d seen = from_end + error;
      seen.x() += (v_deskew_mps - speed_mps) * point.time_s;
      point.position = seen.cast<float>();
      features.planes.push_back(point);
    };
    const double here = speed_mps * end_s;
    for (int k = 0; k < 1200; ++k) {
      add({here - 20.0 + 40.0 * uniform(random), -5.0 + 13.0 * uniform(random), -1.7});
      add({here - 20.0 + 40.0 * uniform(random), -5.0, -1.7 + 4.0 * uniform(random)});
    }
    for (const double front : kFronts) {
      if (front < here + 8.0 || front > here + 25.0) continue;
      for (int k = 0; k < 120; ++k) add({front, 3.0 + 4.0 * uniform(random), -1.7 + 4.0 * uniform(random)});
    }
    return features;
  }

 private:
  static constexpr double kFronts[] = {9.3, 13.1, 16.4, 21.2, 24.0, 28.7, 32.9, 35.2};
};

/// Without an IMU the velocity of one scan deskews the next.
TEST(ScanEstimator, VelocityFadesToTheTruthWithoutAnImu) {
  constexpr double kSpeed = 3.0;
  Reporter reporter;
  Estimator estimator(Config(), &reporter);
  for (int k = 0; k < 40; ++k) {
    const std::optional<imu::NavState> before = estimator.state();
    const double v_deskew = before ? before->v_odom.x() : 0.0;
    const FeatureSet features = Street().scan(kPeriod_s * k, kSpeed, v_deskew, static_cast<unsigned>(k + 1));
    const auto result = estimator.add(features, degeneracy::Degeneracy(), std::nullopt);
    ASSERT_TRUE(result);
    if (k >= 30) {
      EXPECT_NEAR(result->state.v_odom.x(), kSpeed, 0.2) << k;
    }
  }
}

}  // namespace
}  // namespace fdi_lio::mapping
