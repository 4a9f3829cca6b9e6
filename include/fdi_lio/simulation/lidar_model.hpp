#pragma once

#include <string>
#include <vector>

#include "fdi_lio/simulation/scenario.hpp"

namespace fdi_lio::simulation {

enum class CloudLayout { kVelodyne, kOuster };

/// Nominal direction of one beam in the lidar frame.
struct Beam {
  double elevation_rad = 0.0;
  double azimuth_offset_rad = 0.0;  ///< added to the azimuth of the column
};

/// Data sheet of a spinning lidar. The rotor turns clockwise seen from above.
struct LidarModel {
  std::string name;
  CloudLayout layout = CloudLayout::kVelodyne;
  std::vector<Beam> beams;  ///< in order of the reported ring number
  int columns = 1800;
  double rate_hz = 10.0;
  double min_range_m = 0.9;
  double max_range_m = 120.0;
  double range_at_10_percent_m = 50.0;  ///< where half of the pulses on a surface of reflectivity 0.1 return
  double intensity_half_range_m = 200.0;  ///< where calibrated intensities have fallen to a half
  double range_noise_m = 0.02;
  double range_quantum_m = 0.002;
  double divergence_rad = 0.002;  ///< full angle

  double period_s() const { return 1.0 / rate_hz; }
};

/// The model that the settings ask for, with the settings' overrides applied. Throws Error for an unknown
/// name.
LidarModel make_lidar_model(const LidarSettings& settings);

}  // namespace fdi_lio::simulation
