#include "fdi_lio/matching/local_map.hpp"

#include <tbb/parallel_invoke.h>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::matching {

namespace {

constexpr double kInsertDistance = 0.05;  ///< between scans that enter [m]
constexpr double kInsertAngle = 0.01;     ///< or this [rad]
constexpr int kFirstInserted = 10;        ///< scans that enter without having moved
constexpr double kTrimDistance = 10.0;    ///< [m]

VoxelMapConfig map_config(const MappingConfig& mapping, double voxel_m, double max_thickness_m) {
  VoxelMapConfig config;
  config.voxel_size_m = voxel_m;
  config.min_points = static_cast<std::uint32_t>(mapping.plane_min_points);
  config.max_points = static_cast<std::uint32_t>(mapping.max_points_per_voxel);
  config.max_thickness_m = max_thickness_m;
  return config;
}

VoxelMapConfig texture_map_config(const MappingConfig& mapping) {
  VoxelMapConfig config = map_config(mapping, mapping.intensity_voxel_m, mapping.plane_max_thickness_m);
  config.with_texture = true;
  return config;
}

void insert_points(const std::vector<Point>& source, const Eigen::Isometry3d& T_odom_lidar, VoxelMap* map) {
  std::vector<Eigen::Vector3d> points;
  std::vector<float> intensities;
  points.reserve(source.size());
  intensities.reserve(source.size());
  for (const Point& point : source) {
    points.push_back(T_odom_lidar * point.position.cast<double>());
    intensities.push_back(point.intensity);
  }
  map->insert(points, intensities, T_odom_lidar);
}

}  // namespace

LocalMap::LocalMap(const MappingConfig& config)
    : config_(config),
      planes_(map_config(config, config.map_voxel_m, config.plane_max_thickness_m)),
      edges_(map_config(config, config.map_voxel_m, config.line_max_thickness_m)),
      textures_(texture_map_config(config)) {}

bool LocalMap::has_moved_on(const Eigen::Isometry3d& T_odom_imu) const {
  const Eigen::Isometry3d T = T_odom_inserted_.inverse() * T_odom_imu;
  return T.translation().norm() > kInsertDistance ||
         so3::log(Eigen::Matrix3d(T.rotation())).norm() > kInsertAngle;
}

void LocalMap::insert(const FeatureSet& features, const Eigen::Isometry3d& T_odom_imu,
                      const Eigen::Isometry3d& T_imu_lidar) {
  if (inserted_ >= kFirstInserted && !has_moved_on(T_odom_imu)) return;
  ++inserted_;
  T_odom_inserted_ = T_odom_imu;
  const Eigen::Isometry3d T_odom_lidar = T_odom_imu * T_imu_lidar;
  const bool is_trimmed = (T_odom_imu.translation() - trimmed_at_).norm() > kTrimDistance;
  if (is_trimmed) trimmed_at_ = T_odom_imu.translation();
  const auto update = [&](const std::vector<Point>& points, bool is_used, VoxelMap* map) {
    if (is_used) insert_points(points, T_odom_lidar, map);
    if (is_trimmed) map->tidy(trimmed_at_, config_.map_radius_m);
  };
  tbb::parallel_invoke([&] { update(features.planes, true, &planes_); },
                       [&] { update(features.edges, config_.use_edges, &edges_); },
                       [&] { update(features.intensity_edges, config_.use_intensity, &textures_); });
}

std::vector<Point> LocalMap::points() const {
  std::vector<Point> points;
  for (const VoxelMap* map : {&planes_, &edges_}) {
    for (const Cell* cell : map->finest_cells()) {
      Point point;
      point.position = cell->mean.cast<float>();
      point.intensity = cell->mean_intensity;
      points.push_back(point);
    }
  }
  return points;
}

}  // namespace fdi_lio::matching
