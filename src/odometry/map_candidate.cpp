#include "fdi_lio/odometry/map_candidate.hpp"

#include <utility>

namespace fdi_lio::odometry {

namespace {

/// So many scans in a row must know those before.
constexpr int kAgreeingScans = 4;
/// Share of a scan's features that it must know. Of the first scans of a recording two thirds find matches.
constexpr double kMinShare = 0.3;
/// From scan to scan the prediction is good to centimetres; what covers the lidar moves along by decimetres.
constexpr double kMaxResidualM = 0.15;
/// What stands still is known at the predicted pose as well as if it moved along, but for chance.
constexpr double kMinAdvantage = 0.9;

}  // namespace

MapCandidate::MapCandidate(const Config& config)
    : config_(config),
      T_imu_lidar_(config.sensor.T_imu_lidar()),
      matcher_(config),
      map_(config.mapping),
      along_(config.mapping) {}

bool MapCandidate::add(const FeatureSet& features, const matching::MatchInput& input,
                       const imu::NavState& predicted) {
  const auto known = [&](const matching::LocalMap& map, const Eigen::Isometry3d& T_map_imu) {
    matching::MatchSettings settings;
    settings.wide = true;
    settings.max_residual_m = kMaxResidualM;
    const matching::LidarInformation information =
        matcher_.linearise(input, map.planes(), map.edges(), Eigen::Quaterniond(T_map_imu.rotation()),
                           T_map_imu.translation(), settings);
    return static_cast<double>(information.planes + information.edges);
  };
  const Eigen::Isometry3d T_along = Eigen::Isometry3d::Identity();
  const double standing = known(map_, predicted.T_odom_imu());
  const double along = known(along_, T_along);
  const auto count = static_cast<double>(input.planes.size() + input.edges.size());
  const bool agrees = standing > 0.0 && standing >= kMinShare * count && standing >= kMinAdvantage * along;
  if (!agrees) reset();
  if (agrees) ++agreeing_;
  map_.insert(features, predicted.T_odom_imu(), T_imu_lidar_);
  along_.insert(features, T_along, T_imu_lidar_);
  return agreeing_ >= kAgreeingScans;
}

void MapCandidate::reset() {
  if (!map_.empty()) take();
  agreeing_ = 0;
}

matching::LocalMap MapCandidate::take() {
  agreeing_ = 0;
  along_ = matching::LocalMap(config_.mapping);
  return std::exchange(map_, matching::LocalMap(config_.mapping));
}

}  // namespace fdi_lio::odometry
