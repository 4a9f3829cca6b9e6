#pragma once

#include <cmath>
#include <cstdint>
#include <random>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"

/// Scans of an endless road by a spinning lidar that drives along it, for the tests of starts in motion.
namespace fdi_lio::odometry {

struct SyntheticRoad {
  double roughness = 0.6;          ///< of ln(1 + intensity) between patches of 1 m
  double beam_error = 0.3;         ///< of ln(1 + intensity) between rings: travels with the sensor
  bool with_traffic = true;        ///< two boxes that keep their place beside the sensor
  double walls_m = 0.0;            ///< from the sensor to either side; 0: none
  double height_m = 1.8;           ///< of the sensor above the road
  double acceleration_mps2 = 0.0;  ///< along the first axis

  static constexpr int kRings = 48;
  static constexpr double kPeriod_s = 0.1;
  static constexpr double kPi = 3.14159265358979;

  /// What the sensor, level and with its first axis `yaw` from the road's, sees of the scan at `time_s`: as
  /// if it were deskewed for rotation alone. At the start it drives with `speed_mps` along the first axis.
  FeatureSet scan(double time_s, double speed_mps, double yaw, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> jitter(0.0, 1.0);
    std::normal_distribution<double> noise(0.0, 0.05);
    const Eigen::Matrix3d R_lidar_road = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    FeatureSet features;
    features.stamp = static_cast<Stamp>(std::llround(time_s * 1e9));
    // Walls are seen by as many beams that look upwards.
    for (int ring = 0; ring < (walls_m > 0.0 ? 2 * kRings : kRings); ++ring) {
      const double elevation = (ring < kRings ? -25.0 + 0.5 * ring : 0.5 * (ring - kRings)) * kPi / 180.0;
      for (int column = 0; column < 180; ++column) {
        const double turned = (column + jitter(random)) / 180.0;
        const double azimuth = 2.0 * kPi * turned;
        const double at_s = time_s + kPeriod_s * turned;
        const double x = speed_mps * at_s + 0.5 * acceleration_mps2 * at_s * at_s;
        double range = elevation < 0.0 ? height_m / std::sin(-elevation) : 1000.0;
        Eigen::Vector3d seen =
            range * Eigen::Vector3d(std::cos(azimuth) * std::cos(elevation),
                                    std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
        double brightness = 3.0 + roughness * patch(seen.x() + x, seen.y());
        if (with_traffic && std::abs(std::abs(azimuth - kPi) - 0.5 * kPi) < 0.4 && range > 6.0) {
          // The side of a vehicle that drives 5 m to the left, and one to the right.
          seen *= 5.0 / std::abs(seen.y());
          brightness = 3.0 + roughness * patch(seen.x(), 100.0 + seen.z());
        }
        if (walls_m > 0.0 && std::abs(seen.y()) > walls_m) {
          seen *= walls_m / std::abs(seen.y());
          brightness = 3.0 + roughness * patch(seen.x() + x, 200.0 + seen.z() + seen.y());
        }
        brightness += beam_error * patch(ring, 1000.0) - 0.03 * seen.norm() + noise(random);
        Point point;
        point.position = (R_lidar_road * seen).cast<float>();
        point.time_s = static_cast<float>(kPeriod_s * turned);
        point.intensity = static_cast<float>(std::expm1(std::max(0.0, brightness)));
        point.ring = static_cast<std::uint16_t>(ring);
        features.planes.push_back(point);
      }
    }
    return features;
  }

 private:
  /// In [-1, 1], by the patch of 1 m.
  static double patch(double x, double y) {
    std::minstd_rand random(
        static_cast<unsigned>(1 + 73856093 * std::abs(static_cast<long>(std::floor(x)) + 5000) +
                              19349663 * std::abs(static_cast<long>(std::floor(y)) + 5000)));
    random.discard(3);
    return 2.0 * static_cast<double>(random()) / static_cast<double>(std::minstd_rand::max()) - 1.0;
  }
};

}  // namespace fdi_lio::odometry
