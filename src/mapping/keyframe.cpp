#include "fdi_lio/mapping/keyframe.hpp"

#include <utility>
#include <vector>

#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

std::vector<Point> moved(const std::vector<Point>& points, const Eigen::Isometry3f& T) {
  std::vector<Point> result = points;
  for (Point& point : result) point.position = T * point.position;
  return result;
}

KeyframeCloud make_keyframe_cloud(const std::vector<Point>& points, const FeatureSet& features,
                                  const Eigen::Isometry3d& T_imu_lidar, double voxel_m) {
  MapBuilder surface(voxel_m, points.size() / 2);
  surface.add(points, T_imu_lidar);
  const Eigen::Isometry3f T = T_imu_lidar.cast<float>();
  return {surface.points(), moved(features.planes, T), moved(features.edges, T)};
}

}  // namespace

Keyframe make_keyframe(const EstimateResult& estimate, DeskewedScan scan, const FeatureSet& features,
                       const Eigen::Isometry3d& T_imu_lidar, double voxel_m) {
  Keyframe keyframe;
  keyframe.stamp = estimate.state.stamp;
  keyframe.T_odom_imu = estimate.state.T_odom_imu();
  keyframe.covariance = estimate.map_covariance;
  if (estimate.state.imu_status == imu::ImuStatus::kInitialised)
    keyframe.down_imu = (estimate.state.q_odom_imu.conjugate() * estimate.state.g_odom).normalized();
  keyframe.cloud = make_keyframe_cloud(scan.points, features, T_imu_lidar, voxel_m);
  auto image = std::make_shared<scan::RangeImage>();
  image->build(&scan);
  keyframe.image = std::move(image);
  return keyframe;
}

}  // namespace fdi_lio::mapping
