#pragma once

#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/keyframe_store.hpp"
#include "fdi_lio/mapping/map_builder.hpp"
#include "fdi_lio/odometry/estimate_result.hpp"
#include "fdi_lio/scan/range_image.hpp"

namespace fdi_lio::mapping {

/// What the odometry gives for one keyframe.
struct Keyframe {
  Stamp stamp = 0;
  Eigen::Isometry3d T_odom_imu = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_odom_imu against the local map, [dtheta, dt (odom)]
  /// Unit vector towards the centre of the earth in the IMU frame; zero while it is not known. The first of a
  /// session is used.
  Eigen::Vector3d down_imu = Eigen::Vector3d::Zero();
  std::optional<odometry::GravityEstimate> gravity;  ///< the same with what it is confused with
  KeyframeCloud cloud;
  /// Ranges of the scan, which show where it looked through something; may be empty.
  std::shared_ptr<const scan::RangeImage> image;
  /// The first of another session: T_odom_imu is where that is believed to be in the odometry of the one
  /// before, but no way leads from the keyframe before to this one. Loops make it sure.
  bool begins_session = false;
};

/// Makes keyframes of scans, one after the other.
class KeyframeMaker {
 public:
  /// The surfaces are thinned to one mean point a voxel of `voxel_m`.
  KeyframeMaker(const Eigen::Isometry3d& T_imu_lidar, double voxel_m)
      : T_imu_lidar_(T_imu_lidar), surface_(voxel_m) {}

  /// The keyframe of a scan with its estimate. Points and features are moved from the lidar to the IMU frame.
  Keyframe make(const odometry::EstimateResult& estimate, DeskewedScan scan, const FeatureSet& features);

 private:
  Eigen::Isometry3d T_imu_lidar_;
  MapBuilder surface_;  ///< memory of `make`, which fresh pages would cost a fifth of its time
};

}  // namespace fdi_lio::mapping
