#include "fdi_lio/simulation/lidar_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/random_streams.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr std::size_t kColumnsPerTask = 30;
constexpr float kBehindSurface = 1e-3f;  // metres to step over a surface that was passed

Eigen::Vector3f direction_of(double azimuth, double elevation) {
  return Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                         std::sin(elevation))
      .cast<float>();
}

/// Share of the light that comes back at an angle of incidence. Real roads and walls are rough and send far
/// more back at grazing incidence than Lambert's cosine: the exponent 3/8 gives the road intensities of
/// KITTI's HDL-64E.
double rough_surface_factor(double cosine) {
  const double fourth_root = std::sqrt(std::sqrt(cosine));
  return fourth_root * std::sqrt(fourth_root);
}

}  // namespace

/// Where and when one column is fired.
struct LidarSimulator::Column {
  double t = 0.0;
  float azimuth_cos = 1.0f;
  float azimuth_sin = 0.0f;
  Eigen::Isometry3f T_map_lidar = Eigen::Isometry3f::Identity();
  std::vector<PosedObject> objects;

  /// Turns a direction at column azimuth 0 to this column's.
  Eigen::Vector3f turned(const Eigen::Vector3f& d) const {
    return {azimuth_cos * d.x() - azimuth_sin * d.y(), azimuth_sin * d.x() + azimuth_cos * d.y(), d.z()};
  }
};

LidarSimulator::LidarSimulator(const World& world, const Trajectory& trajectory, LidarModel model,
                               LidarErrors errors, double dust_per_m, const LidarSettings& settings,
                               std::uint64_t seed)
    : world_(world),
      trajectory_(trajectory),
      model_(std::move(model)),
      errors_(std::move(errors)),
      dust_per_m_(dust_per_m),
      start_azimuth_rad_(settings.start_azimuth_deg * M_PI / 180.0),
      seed_(seed) {
  for (std::size_t i = 0; i < model_.beams.size(); ++i) {
    const Beam& beam = model_.beams[i];
    nominal_directions_.push_back(direction_of(beam.azimuth_offset_rad, beam.elevation_rad));
    true_directions_.push_back(direction_of(beam.azimuth_offset_rad + errors_.azimuth_rad[i],
                                            beam.elevation_rad + errors_.elevation_rad[i]));
  }
}

LidarScan LidarSimulator::simulate(int index) const {
  LidarScan scan;
  scan.start_s = index / model_.rate_hz;
  scan.period_s = model_.period_s();
  scan.columns = model_.columns;
  scan.beams = static_cast<int>(model_.beams.size());
  scan.returns.resize(static_cast<std::size_t>(scan.columns) * model_.beams.size());
  const Eigen::Isometry3d T_map_lidar = trajectory_.pose(scan.start_s) * errors_.T_imu_lidar;
  const std::vector<NearObject> near =
      world_.objects_near(T_map_lidar.translation(), scan.start_s, scan.period_s, model_.max_range_m);
  parallel_chunks(static_cast<std::size_t>(scan.columns), kColumnsPerTask,
                  [&](std::size_t begin, std::size_t end, std::size_t) {
                    for (std::size_t column = begin; column < end; ++column) {
                      simulate_column(index, static_cast<int>(column), near, &scan);
                    }
                  });
  return scan;
}

void LidarSimulator::simulate_column(int scan, int index, const std::vector<NearObject>& near,
                                     LidarScan* result) const {
  Random random(seed_, kStreamLidar,
                static_cast<std::uint64_t>(scan) * 65536u + static_cast<std::uint64_t>(index));
  Column column;
  column.t = result->start_s + result->column_time(index);
  const double azimuth = start_azimuth_rad_ - 2.0 * M_PI * index / result->columns;  // clockwise from above
  column.azimuth_cos = static_cast<float>(std::cos(azimuth));
  column.azimuth_sin = static_cast<float>(std::sin(azimuth));
  const Eigen::Isometry3d T_map_lidar = trajectory_.pose(column.t) * errors_.T_imu_lidar;
  column.T_map_lidar = T_map_lidar.cast<float>();
  if (!near.empty()) {
    Eigen::Vector3d forward =
        T_map_lidar.linear() * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0.0);
    forward.z() = 0.0;
    column.objects = world_.objects_in_column(T_map_lidar.translation(), forward.normalized(), column.t,
                                              static_cast<double>(index) / result->columns, near);
  }
  LidarReturn* returns = &result->returns[static_cast<std::size_t>(index) * model_.beams.size()];
  RayPacket rays;
  rays.origin = column.T_map_lidar.translation();
  Hit hits[kPacketSize];
  for (std::size_t first = 0; first < model_.beams.size(); first += kPacketSize) {
    rays.count = std::min(kPacketSize, model_.beams.size() - first);
    for (std::size_t i = 0; i < rays.count; ++i) {
      rays.directions[i] = column.T_map_lidar.linear() * column.turned(true_directions_[first + i]);
    }
    world_.intersect(rays, static_cast<float>(model_.max_range_m), column.objects, hits);
    for (std::size_t i = 0; i < rays.count; ++i)
      returns[first + i] = measure(column, first + i, hits[i], &random);
  }
}

LidarReturn LidarSimulator::measure(const Column& column, std::size_t beam, Hit hit, Random* random) const {
  LidarReturn point;
  const Eigen::Vector3f direction = column.T_map_lidar.linear() * column.turned(true_directions_[beam]);
  hit = through_glass(column, direction, hit, random);
  double reflectivity = 0.2;
  double cosine = 1.0;
  double retro = 0.0;
  double range = hit.range;
  const double dust_range = dust_per_m_ > 0.0 ? -std::log(1.0 - random->uniform()) / dust_per_m_ : 1e9;
  if (dust_range < (hit.range > 0.0f ? range : model_.max_range_m)) {
    range = dust_range;
    reflectivity = 0.05;
    hit.object = 0;
  } else if (hit.range > 0.0f) {
    const Material& material = world_.material(hit.material);
    reflectivity = reflectivity_at(material, hit.uv);
    cosine = std::abs(static_cast<double>(direction.dot(hit.normal)));
    retro = material.retro_gain;
    range = mixed_range(column, direction, hit, random);
  } else {
    return point;
  }
  const double effective = retro > 0.0 ? retro : reflectivity * rough_surface_factor(cosine);
  const double threshold = 0.1 / (model_.range_at_10_percent_m * model_.range_at_10_percent_m);
  const double signal = effective / (range * range) / threshold;  // 1 where half of the pulses return
  const double sharpened = signal * signal * signal;
  const double detected = sharpened * sharpened / (1.0 + sharpened * sharpened);
  if (!random->chance(detected * (1.0 - errors_.dropout))) return point;
  const double noise_scale = errors_.weak_signal_noise ? 1.0 + 0.5 * std::min(1.0, 1.0 / signal) : 1.0;
  range += model_.range_noise_m * noise_scale * random->normal() + errors_.range_m[beam];
  range += errors_.range_walk_m * std::clamp(1.0 - 2.0 * std::sqrt(effective), -1.0, 1.0);
  range = model_.range_quantum_m * std::round(range / model_.range_quantum_m);
  if (range < model_.min_range_m || range > model_.max_range_m) return point;
  point.valid = true;
  point.range_m = static_cast<float>(range);
  point.p_lidar = point.range_m * column.turned(nominal_directions_[beam]);
  point.label = hit.object;
  fill_intensity(effective, retro > 0.0, range, beam, random, &point);
  return point;
}

Hit LidarSimulator::through_glass(const Column& column, const Eigen::Vector3f& direction, Hit hit,
                                  Random* random) const {
  constexpr int kMaxPanes = 4;
  for (int pane = 0; pane < kMaxPanes && hit.range > 0.0f; ++pane) {
    const Material& material = world_.material(hit.material);
    if (material.pass_share <= 0.0f && material.mirror_share <= 0.0f) return hit;
    const bool head_on = std::abs(direction.dot(hit.normal)) > 0.98f;
    const double draw = random->uniform();
    if (head_on || draw > material.pass_share + material.mirror_share) return hit;
    if (draw > material.pass_share) return Hit();
    hit = world_.intersect(column.T_map_lidar.translation(), direction, hit.range + kBehindSurface,
                           static_cast<float>(model_.max_range_m), column.objects);
  }
  return hit;
}

double LidarSimulator::mixed_range(const Column& column, const Eigen::Vector3f& direction, const Hit& hit,
                                   Random* random) const {
  constexpr double kPulseLengthM = 0.6;  // echoes that are closer than this melt into one
  if (!random->chance(errors_.mixed_share)) return hit.range;
  const Eigen::Vector3f side = direction.unitOrthogonal();
  const double angle = 2.0 * M_PI * random->uniform();
  const double offset = 0.5 * model_.divergence_rad * random->uniform();
  const Eigen::Vector3f other = (direction + static_cast<float>(offset * std::cos(angle)) * side +
                                 static_cast<float>(offset * std::sin(angle)) * direction.cross(side))
                                    .normalized();
  const Hit second = world_.intersect(column.T_map_lidar.translation(), other, 0.0f,
                                      static_cast<float>(model_.max_range_m), column.objects);
  if (second.range < 0.0f || second.object != hit.object) return hit.range;
  if (std::abs(second.range - hit.range) > kPulseLengthM) return hit.range;
  const double share = random->uniform();
  return share * hit.range + (1.0 - share) * second.range;
}

void LidarSimulator::fill_intensity(double effective, bool retro, double range, std::size_t beam,
                                    Random* random, LidarReturn* point) const {
  const double noise = 1.0 + 0.04 * random->rough_normal();
  const double gain = errors_.gain[beam];
  const double relative = range / model_.intensity_half_range_m;
  const double range_residue = 1.0 / (1.0 + relative * relative);  // what the calibration leaves
  double calibrated = 100.0 * effective * gain * noise * range_residue + random->rough_normal();
  if (retro) calibrated = 100.0 + 155.0 * (1.0 - std::exp(-effective / 3.0)) * noise;
  calibrated = std::clamp(std::round(calibrated), 0.0, 255.0);
  if (model_.layout == CloudLayout::kVelodyne) {
    point->intensity = static_cast<float>(calibrated);
    return;
  }
  constexpr double kPhotons = 6e4;     // at 1 m from a white surface, without the near-range loss
  constexpr double kNearLossM2 = 4.0;  // lens overlap: less light from very near
  const double photons = kPhotons * effective * gain / (range * range + kNearLossM2);
  const double counted = photons + std::sqrt(photons) * random->rough_normal();
  point->intensity = static_cast<float>(std::clamp(std::round(counted), 1.0, 65535.0));
  point->reflectivity = static_cast<std::uint16_t>(calibrated);
  point->ambient = static_cast<std::uint16_t>(std::clamp(60.0 + 500.0 * effective * noise, 0.0, 65535.0));
}

}  // namespace fdi_lio::simulation
