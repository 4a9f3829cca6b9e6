#include "fdi_lio/odometry/stated_covariance.hpp"

#include <cmath>

#include "fdi_lio/odometry/mounting.hpp"

namespace fdi_lio::odometry {

StatedCovariance::StatedCovariance(const Config& config)
    : factor_(config.mapping.covariance_factor),
      mounting_sigma_rad_(config.sensor.mounting_sigma_deg * M_PI / 180.0),
      drift_(config.mapping.drift_share) {}

void StatedCovariance::advance(const imu::NavState& before, const imu::NavState& now,
                               const Matrix6d& map_covariance, double radius_m) {
  drift_.advance(before, now, map_covariance, radius_m);
  tilt_.advance(before, now);
}

Matrix6d StatedCovariance::covariance(const imu::NavState& now, const Matrix6d& map_covariance,
                                      double noise_scale, const Eigen::Matrix3d& watched) const {
  Matrix6d covariance = noise_scale * factor_ * (map_covariance + drift_.covariance()) +
                        mounting_covariance(T_odom_first_, now.T_odom_imu(), mounting_sigma_rad_) +
                        tilt_.error() * tilt_.error().transpose();
  covariance.bottomRightCorner<3, 3>() += watched;
  return covariance;
}

}  // namespace fdi_lio::odometry
