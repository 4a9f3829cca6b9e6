#include "fdi_lio/mapping/map_candidate.hpp"

#include <utility>

namespace fdi_lio::mapping {

namespace {

/// So many scans in a row must know those before.
constexpr int kAgreeingScans = 4;
/// Share of a scan's features that it must know. Of the first scans of a recording two thirds find matches.
constexpr double kMinShare = 0.3;
/// From scan to scan the prediction is good to centimetres; what covers the lidar moves along by decimetres.
constexpr double kMaxResidualM = 0.15;

}  // namespace

MapCandidate::MapCandidate(const Config& config)
    : config_(config), T_imu_lidar_(config.sensor.T_imu_lidar()), matcher_(config), map_(config.mapping) {}

bool MapCandidate::add(const FeatureSet& features, const MatchInput& input, const imu::NavState& predicted) {
  MatchSettings settings;
  settings.wide = true;
  settings.max_residual_m = kMaxResidualM;
  const LidarInformation information = matcher_.linearise(
      input, map_.planes(), map_.edges(), predicted.q_odom_imu, predicted.t_odom_imu, settings);
  const std::size_t matched = information.planes + information.edges;
  const std::size_t count = input.planes.size() + input.edges.size();
  const bool agrees = matched > 0 && static_cast<double>(matched) >= kMinShare * static_cast<double>(count);
  if (!agrees) reset();
  if (agrees) ++agreeing_;
  map_.insert(features, predicted.T_odom_imu(), T_imu_lidar_);
  return agreeing_ >= kAgreeingScans;
}

void MapCandidate::reset() {
  if (!map_.empty()) map_ = LocalMap(config_.mapping);
  agreeing_ = 0;
}

LocalMap MapCandidate::take() {
  agreeing_ = 0;
  return std::exchange(map_, LocalMap(config_.mapping));
}

}  // namespace fdi_lio::mapping
