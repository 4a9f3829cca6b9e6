#pragma once

#include <Eigen/Core>

namespace fdi_lio::odometry {

/// Of one scan about its position, as far as it is more than noise; odom axes [1/m^2].
struct TrustedInformation {
  Eigen::Matrix3d surfaces = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d all = Eigen::Matrix3d::Zero();  ///< of surfaces and textures
};

}  // namespace fdi_lio::odometry
