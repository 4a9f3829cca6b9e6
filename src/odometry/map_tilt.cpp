#include "fdi_lio/odometry/map_tilt.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr double kSettleM = 20.0;

}  // namespace

void MapTilt::advance(const imu::NavState& before, const imu::NavState& now) {
  if (now.imu_status != imu::ImuStatus::kInitialised) return;
  const Eigen::Vector3d step = now.t_odom_imu - before.t_odom_imu;
  way_m_ += step.norm();
  if (!g_begin_ || way_m_ < kSettleM) g_begin_ = now.g_odom;
  const Eigen::Vector3d phi = g_begin_->cross(now.g_odom) / g_begin_->squaredNorm();
  error_.head<3>() = -(now.q_odom_imu.conjugate() * phi);
  error_.tail<3>() -= phi.cross(step);
}

}  // namespace fdi_lio::odometry
