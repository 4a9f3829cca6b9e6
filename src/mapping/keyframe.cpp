#include "fdi_lio/mapping/keyframe.hpp"

#include <utility>
#include <vector>

#include "fdi_lio/mapping/moving_columns.hpp"

namespace fdi_lio::mapping {

namespace {

std::vector<Point> moved(std::vector<Point> points, const Eigen::Isometry3f& T) {
  for (Point& point : points) point.position = T * point.position;
  return points;
}

}  // namespace

Keyframe KeyframeMaker::make(const odometry::EstimateResult& estimate, DeskewedScan scan,
                             const FeatureSet& features) {
  Keyframe keyframe;
  keyframe.stamp = estimate.state.stamp;
  keyframe.T_odom_imu = estimate.state.T_odom_imu();
  keyframe.covariance = estimate.map_covariance;
  if (estimate.state.imu_status == imu::ImuStatus::kInitialised)
    keyframe.down_imu = (estimate.state.q_odom_imu.conjugate() * estimate.state.g_odom).normalized();
  keyframe.gravity = estimate.gravity;
  const MovingColumns columns(scan, keyframe.T_odom_imu.linear() * T_imu_lidar_.linear());
  surface_.clear();
  surface_.add(columns.without(scan.points), T_imu_lidar_);
  const Eigen::Isometry3f T = T_imu_lidar_.cast<float>();
  keyframe.cloud = {surface_.points(), moved(columns.without(features.planes), T),
                    moved(columns.without(features.edges), T)};
  auto image = std::make_shared<scan::RangeImage>();
  image->build(&scan);
  keyframe.image = std::move(image);
  return keyframe;
}

}  // namespace fdi_lio::mapping
