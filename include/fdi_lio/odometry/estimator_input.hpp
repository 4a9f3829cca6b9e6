#pragma once

#include <optional>

#include <Eigen/Core>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// What came with one scan.
struct EstimatorInput {
  FeatureSet features;
  degeneracy::Degeneracy degeneracy;
  std::optional<imu::Preintegration> imu;
  Eigen::Vector3d v_deskew = Eigen::Vector3d::Zero();  ///< the features were deskewed with it [m/s], in odom
};

}  // namespace fdi_lio::odometry
