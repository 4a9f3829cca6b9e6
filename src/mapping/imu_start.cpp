#include "fdi_lio/mapping/imu_start.hpp"

#include <string>

namespace fdi_lio::mapping {

namespace {

constexpr double kMaxStaticSpeed = 0.1;          ///< [m/s]
constexpr double kRestAccelerationSigma = 0.01;  ///< of the mean over the static duration [m/s^2]
constexpr double kMaxGravityError = 0.5;         ///< [m/s^2]

ImuStart::Found initialised(imu::NavState state, const Smoother::InitialSigma& sigma) {
  state.imu_status = imu::ImuStatus::kInitialised;
  return {state, sigma};
}

}  // namespace

std::optional<ImuStart::Found> ImuStart::at_rest(const imu::NavState& newest,
                                                 const imu::Preintegration& imu) const {
  if (!imu::is_static(imu.recent, config_.imu) || newest.v_odom.norm() > kMaxStaticSpeed) return std::nullopt;
  imu::NavState state = newest;
  state.v_odom.setZero();
  state.gyro_bias = imu.recent.mean_angular_velocity;
  state.accel_bias.setZero();
  state.g_odom =
      -config_.sensor.gravity_mps2 * (state.q_odom_imu * imu.recent.mean_acceleration).normalized();
  state.w_imu.setZero();
  Smoother::InitialSigma sigma;
  sigma.velocity = 0.02;
  sigma.gyro_bias = 2e-3;
  sigma.rest_acceleration = kRestAccelerationSigma;
  reporter_->report(Severity::kInfo, "imu_static", "IMU initialised standing still");
  return initialised(state, sigma);
}

std::optional<ImuStart::Found> ImuStart::in_motion(const imu::NavState& before, const imu::NavState& newest,
                                                   const imu::Preintegration& imu) {
  if (intervals_.empty()) first_ = before;
  intervals_.push_back({newest.q_odom_imu, newest.t_odom_imu, imu});
  if (static_cast<int>(intervals_.size()) < config_.imu.moving_init_scans) return std::nullopt;
  const auto aligned =
      imu::align_in_motion(first_.q_odom_imu, first_.t_odom_imu, intervals_, config_.sensor.gravity_mps2);
  if (!aligned || aligned->gravity_error_mps2 > kMaxGravityError) {
    if (aligned) {
      reporter_->report(
          Severity::kWarning, "imu_align",
          "gravity found in motion is off by " + std::to_string(aligned->gravity_error_mps2) +
              " m/s^2: check sensor.T_imu_lidar, sensor.acceleration_unit and the clocks; trying again");
    }
    first_.q_odom_imu = intervals_.front().q_odom_imu;
    first_.t_odom_imu = intervals_.front().t_odom_imu;
    intervals_.erase(intervals_.begin());
    return std::nullopt;
  }
  imu::NavState state = newest;
  state.gyro_bias = aligned->gyro_bias;
  state.accel_bias.setZero();
  state.g_odom = aligned->g_odom;
  state.v_odom = aligned->v_odom;
  state.w_imu = imu.last_angular_velocity - state.gyro_bias;
  Smoother::InitialSigma sigma;
  sigma.velocity = 0.2;
  sigma.gyro_bias = 5e-3;
  sigma.gravity = 0.3;
  sigma.accel_bias = 0.2;
  reporter_->report(Severity::kInfo, "imu_moving", "IMU initialised in motion");
  return initialised(state, sigma);
}

}  // namespace fdi_lio::mapping
