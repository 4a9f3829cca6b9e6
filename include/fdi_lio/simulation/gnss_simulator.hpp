#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

struct GnssFix {
  double time_s = 0.0;  ///< since the start of the recording
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;
  bool valid = false;  ///< false during an outage
};

/// Fixes of the IMU's position: white noise, a slow drift, outliers, and outages. The map's x axis points
/// east, y north.
class GnssSimulator {
 public:
  /// Keeps a reference to `trajectory`.
  GnssSimulator(const Trajectory& trajectory, const GnssSettings& settings, std::uint64_t seed);

  /// The next fix; the first is at t = 0.
  GnssFix next();

 private:
  const Trajectory& trajectory_;
  GnssSettings settings_;
  std::uint64_t seed_;
  std::int64_t count_ = 0;
  Eigen::Vector3d drift_;
};

}  // namespace fdi_lio::simulation
