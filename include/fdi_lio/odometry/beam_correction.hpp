#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/matching/voxel_map.hpp"
#include "fdi_lio/odometry/beam_calibration.hpp"

namespace fdi_lio::odometry {

/// Learns the errors of the beams from the planes of scans that have found their place, and takes them out
/// of later scans.
class BeamCorrection {
 public:
  explicit BeamCorrection(const Config& config);

  /// The features (lidar frame) of a scan with the errors known so far taken out; `state` is that at the
  /// scan's reference stamp, or its prediction.
  FeatureSet apply(FeatureSet features, const imu::NavState& state) const;

  /// From now on `error_rad` more is taken out of the elevation of all beams.
  void add_common_elevation(double error_rad) { beams_.add_common_elevation(error_rad); }

  /// Learns from the planes of a scan that `apply` has corrected, against those planes of the map that many
  /// scans have smoothed.
  void learn(const FeatureSet& corrected, const imu::NavState& state, const matching::VoxelMap& plane_map);

 private:
  Eigen::Vector3d v_lidar(const imu::NavState& state) const;

  BeamCalibration beams_;
  Eigen::Isometry3d T_imu_lidar_;
  double range_variance_m2_;
};

}  // namespace fdi_lio::odometry
