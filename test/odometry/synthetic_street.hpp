#pragma once

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/preintegration.hpp"

/// Scans of a street and readings of an IMU, for the tests of the estimator.
namespace fdi_lio::odometry {

constexpr double kPeriod_s = 0.1;  ///< from scan to scan

/// A street whose fronts across the way all stand ahead to the left, where the sweep begins.
class SyntheticStreet {
 public:
  /// What is seen of the sweep that ends at `end_s` and at x = `here_m`, deskewed with `v_deskew` along x.
  FeatureSet scan(double end_s, double here_m, double speed_mps, double v_deskew_mps, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::normal_distribution<double> noise(0.0, 0.01);
    FeatureSet features;
    features.stamp = static_cast<Stamp>(std::llround(1e9 * end_s));
    const auto add = [&](const Eigen::Vector3d& place) {
      // The sweep begins ahead and goes round to the left.
      const Eigen::Vector3d from_end(place.x() - here_m, place.y(), place.z());
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
    for (int k = 0; k < 1200; ++k) {
      add({here_m - 20.0 + 40.0 * uniform(random), -5.0 + 13.0 * uniform(random), -1.7});
      add({here_m - 20.0 + 40.0 * uniform(random), -5.0, -1.7 + 4.0 * uniform(random)});
    }
    for (const double front : kFronts) {
      if (front < here_m + 8.0 || front > here_m + 25.0) continue;
      for (int k = 0; k < 120; ++k) add({front, 3.0 + 4.0 * uniform(random), -1.7 + 4.0 * uniform(random)});
    }
    return features;
  }

 private:
  static constexpr double kFronts[] = {9.3, 13.1, 16.4, 21.2, 24.0, 28.7, 32.9, 35.2};
};

/// Readings of the interval before `time_s` that are always the same.
inline imu::Preintegration steady_imu(double time_s, const Eigen::Vector3d& felt) {
  std::vector<imu::ImuSample> samples;
  for (int n = -20; n <= 0; ++n) {
    samples.push_back({to_nanoseconds(time_s + 0.05 * kPeriod_s * n), felt, Eigen::Vector3d::Zero()});
  }
  imu::Preintegration imu = imu::preintegrate(samples, samples.front().stamp, samples.back().stamp, {},
                                              imu::ImuNoise(), ImuConfig());
  imu.recent.count = 200;
  imu.recent.duration_s = 1.0;
  imu.recent.mean_acceleration = felt;
  imu.recent.acceleration_std = 1.0;
  return imu;
}

}  // namespace fdi_lio::odometry
