#include "fdi_lio/mapping/keyframe.hpp"

#include <utility>
#include <vector>

namespace fdi_lio::mapping {

namespace {

std::vector<Point> moved(const std::vector<Point>& points, const Eigen::Isometry3f& T) {
  std::vector<Point> result = points;
  for (Point& point : result) point.position = T * point.position;
  return result;
}

}  // namespace

Keyframe KeyframeMaker::make(const EstimateResult& estimate, DeskewedScan scan, const FeatureSet& features) {
  Keyframe keyframe;
  keyframe.stamp = estimate.state.stamp;
  keyframe.T_odom_imu = estimate.state.T_odom_imu();
  keyframe.covariance = estimate.map_covariance;
  if (estimate.state.imu_status == imu::ImuStatus::kInitialised)
    keyframe.down_imu = (estimate.state.q_odom_imu.conjugate() * estimate.state.g_odom).normalized();
  surface_.clear();
  surface_.add(scan.points, T_imu_lidar_);
  const Eigen::Isometry3f T = T_imu_lidar_.cast<float>();
  keyframe.cloud = {surface_.points(), moved(features.planes, T), moved(features.edges, T)};
  auto image = std::make_shared<scan::RangeImage>();
  image->build(&scan);
  keyframe.image = std::move(image);
  return keyframe;
}

}  // namespace fdi_lio::mapping
