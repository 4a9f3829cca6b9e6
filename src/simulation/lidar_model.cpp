#include "fdi_lio/simulation/lidar_model.hpp"

#include <cmath>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kDegree = M_PI / 180.0;

/// Velodyne HDL-64E S2: 32 beams 1/2 degree apart from -24.8 to -8.83, then 32 beams 1/3 degree apart up to
/// +2.
LidarModel hdl64e() {
  LidarModel model;
  model.intensity_half_range_m = 35.0;  // as in KITTI's recordings
  for (int i = 0; i < 32; ++i) model.beams.push_back({(-24.8 + i * (15.97 / 31.0)) * kDegree, 0.0});
  for (int i = 0; i < 32; ++i) model.beams.push_back({(-8.33 + i / 3.0) * kDegree, 0.0});
  return model;
}

LidarModel vlp16() {
  LidarModel model;
  for (int i = 0; i < 16; ++i) model.beams.push_back({(-15.0 + 2.0 * i) * kDegree, 0.0});
  model.max_range_m = 100.0;
  model.min_range_m = 0.5;
  model.range_at_10_percent_m = 45.0;
  model.divergence_rad = 0.003;
  return model;
}

/// Ouster numbers its beams from the top. Neighbouring beams of an OS1-64 look into four azimuths.
LidarModel ouster(int count, double half_field_deg, const std::vector<double>& azimuth_offsets_deg) {
  LidarModel model;
  model.layout = CloudLayout::kOuster;
  for (int i = 0; i < count; ++i) {
    const double elevation = half_field_deg - 2.0 * half_field_deg * i / (count - 1);
    const double offset = azimuth_offsets_deg[static_cast<std::size_t>(i) % azimuth_offsets_deg.size()];
    model.beams.push_back({elevation * kDegree, offset * kDegree});
  }
  model.columns = 1024;
  model.range_quantum_m = 0.001;
  model.min_range_m = 0.5;
  return model;
}

LidarModel os1_64() {
  LidarModel model = ouster(64, 22.5, {3.164, 1.055, -1.055, -3.164});
  model.range_at_10_percent_m = 45.0;
  model.divergence_rad = 0.0031;
  return model;
}

LidarModel os0_128() {
  LidarModel model = ouster(128, 45.0, {0.0});
  model.max_range_m = 50.0;
  model.min_range_m = 0.3;
  model.range_at_10_percent_m = 20.0;
  model.divergence_rad = 0.0061;
  return model;
}

LidarModel by_name(const std::string& name) {
  if (name == "hdl64e") return hdl64e();
  if (name == "vlp16") return vlp16();
  if (name == "os1_64") return os1_64();
  if (name == "os0_128") return os0_128();
  throw Error("unknown lidar model '" + name + "': use hdl64e, vlp16, os1_64 or os0_128");
}

}  // namespace

LidarModel make_lidar_model(const LidarSettings& settings) {
  LidarModel model = by_name(settings.model);
  model.name = settings.model;
  model.rate_hz = settings.rate_hz;
  if (settings.columns > 0) model.columns = settings.columns;
  if (settings.max_range_m > 0.0) model.max_range_m = settings.max_range_m;
  if (settings.range_noise_m >= 0.0) model.range_noise_m = settings.range_noise_m;
  return model;
}

}  // namespace fdi_lio::simulation
