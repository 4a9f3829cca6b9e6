#pragma once

#include <string>
#include <vector>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/estimate_result.hpp"
#include <fdi_lio/Degeneracy.h>
#include <fdi_lio/DeskewedCloud.h>
#include <fdi_lio/EstimatorState.h>
#include <fdi_lio/Features.h>
#include <fdi_lio/OptimisationStatus.h>
#include <fdi_lio/PreintegratedImu.h>

/// Between the package's own messages and the types of the library. Every pair loses nothing: a chain of
/// nodes computes the same numbers as one process. Reading throws Error when an array has a wrong length.
namespace fdi_lio::ros_bridge {

ros::Time to_ros_time(Stamp stamp);
Stamp to_stamp(const ros::Time& time);

/// A cloud with the fields x y z intensity time (float32) ring column (uint16), 24 bytes a point.
sensor_msgs::PointCloud2 to_cloud(const std::vector<Point>& points, Stamp stamp, const std::string& frame_id);
/// The points of a cloud that `to_cloud` made; throws Error for any other layout.
std::vector<Point> to_points(const sensor_msgs::PointCloud2& cloud);

DeskewedCloudPtr to_message(const DeskewedScan& scan, const std::string& lidar_frame);
DeskewedScan to_scan(const DeskewedCloud& message);

FeaturesPtr to_message(const FeatureSet& features, const std::string& lidar_frame);
FeatureSet to_features(const Features& message);

DegeneracyPtr to_message(const degeneracy::Degeneracy& degeneracy, const std::string& imu_frame);
degeneracy::Degeneracy to_degeneracy(const Degeneracy& message);

OptimisationStatusPtr to_status_message(const odometry::EstimateResult& estimate,
                                        const std::string& imu_frame);
degeneracy::OptimisationStatus to_status(const OptimisationStatus& message);

/// `answers` is the stamp of the scan that led to this state.
EstimatorStatePtr to_state_message(const odometry::EstimateResult& estimate, Stamp answers,
                                   const std::string& odom_frame, const std::string& imu_frame);
imu::NavState to_state(const EstimatorState& message);

PreintegratedImuPtr to_message(const imu::Preintegration& preintegration, const std::string& imu_frame);
imu::Preintegration to_preintegration(const PreintegratedImu& message);

}  // namespace fdi_lio::ros_bridge
