#include "fdi_lio/odometry/imu_start.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "fdi_lio/odometry/start_ground.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr double kMaxStaticSpeed = 0.1;  ///< [m/s]
/// Of the means over the static duration, beside white noise [m/s^2], [rad/s].
constexpr double kRestAccelerationSigma = 0.01;
constexpr double kRestRateSigma = 2e-3;
constexpr double kMaxGravityError = 0.5;  ///< [m/s^2]
/// Beyond, more scans are waited for, up to so many times as many: a wrong gravity drives off where the lidar
/// hardly sees the way along the road.
constexpr double kGoodGravitySigma = 0.1;
constexpr double kGoodGravityError = 0.15;
constexpr std::size_t kMostWaits = 3;
/// Of what the accelerometer says of gravity: the scatter of the positions is not all of their error.
constexpr double kLeastGravitySigma = 0.02;
constexpr double kGravitySigmas = 2.0;

constexpr double kFirstVelocitySigma = 0.3;  ///< of the first scan, by an alignment in motion [m/s]

ImuStart::Found initialised(imu::NavState state, const Smoother::InitialSigma& sigma) {
  state.imu_status = imu::ImuStatus::kInitialised;
  return {state, sigma, std::nullopt};
}

}  // namespace

std::optional<ImuStart::Found> ImuStart::at_rest(const imu::NavState& newest,
                                                 const imu::Preintegration& imu) const {
  if (!imu::is_static(imu.recent, config_.imu) || newest.v_odom.norm() > kMaxStaticSpeed) return std::nullopt;
  imu::NavState state = newest;
  state.v_odom.setZero();
  state.gyro_bias = imu.recent.mean_angular_velocity;
  // a = b_a - R' g holds, which the smoother starts from: what |a| differs from |g| by is bias.
  const Eigen::Vector3d& felt = imu.recent.mean_acceleration;
  const Eigen::Vector3d up_imu = felt.normalized();
  state.accel_bias = felt - config_.sensor.gravity_mps2 * up_imu;
  state.g_odom = -config_.sensor.gravity_mps2 * (state.q_odom_imu * up_imu);
  state.w_imu.setZero();
  Smoother::InitialSigma sigma;
  sigma.velocity = 0.02;
  sigma.accel_bias = config_.sensor.accel_bias_sigma_mps2;
  const double per_mean = 1.0 / std::sqrt(imu.recent.duration_s);
  sigma.gyro_bias = std::hypot(kRestRateSigma, imu.recent.angular_velocity_noise * per_mean);
  sigma.rest_acceleration = std::hypot(kRestAccelerationSigma, imu.recent.acceleration_noise * per_mean);
  // Whatever the bias is across gravity has tilted what is taken for upwards.
  sigma.gravity = std::max(sigma.accel_bias, sigma.rest_acceleration);
  reporter_->report(Severity::kInfo, "imu_static", "IMU initialised standing still");
  return initialised(state, sigma);
}

ImuStart::Found ImuStart::moving(const imu::NavState& first, const MovingStart& start) const {
  imu::NavState state = first;
  state.v_odom = start.v_odom;
  if (state.imu_status == imu::ImuStatus::kNone) {
    Smoother::InitialSigma sigma;
    sigma.velocity = start.sigma.velocity;
    return {state, sigma, std::nullopt};
  }
  state.gyro_bias = start.gyro_bias;
  state.accel_bias = start.accel_bias;
  state.g_odom = -config_.sensor.gravity_mps2 * start.up_odom;
  return initialised(state, start.sigma);
}

std::optional<ImuStart::Found> ImuStart::in_motion(const imu::NavState& before, const imu::NavState& newest,
                                                   const imu::Preintegration& imu,
                                                   const std::optional<Eigen::Vector3d>& ground_normal) {
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
  const Eigen::Vector3d up_odom = -aligned->g_odom.normalized();
  const bool is_misled = ground_normal && is_steep(*ground_normal, up_odom);
  const bool is_good = !is_misled && aligned->gravity_sigma_mps2 < kGoodGravitySigma &&
                       aligned->gravity_error_mps2 < kGoodGravityError;
  if (!is_good && intervals_.size() < most_intervals(config_.imu)) return std::nullopt;
  imu::NavState state = newest;
  state.gyro_bias = aligned->gyro_bias;
  state.accel_bias = aligned->accel_bias;
  state.g_odom = aligned->g_odom;
  state.v_odom = aligned->v_odom;
  state.w_imu = state.errors().angular_velocity(imu.last_angular_velocity);
  Smoother::InitialSigma sigma;
  sigma.velocity = 0.2;
  sigma.gyro_bias = 5e-3;
  sigma.accel_bias = config_.sensor.accel_bias_sigma_mps2;
  sigma.gravity = sigma.accel_bias;
  sigma.rest_acceleration = std::max(kLeastGravitySigma, kGravitySigmas * aligned->gravity_sigma_mps2);
  reporter_->report(Severity::kInfo, "imu_moving", "IMU initialised in motion");
  Found found = initialised(state, sigma);
  if (is_misled) return found;
  found.start.emplace();
  found.start->v_odom = aligned->v_first;
  found.start->up_odom = up_odom;
  found.start->gyro_bias = aligned->gyro_bias;
  found.start->accel_bias = aligned->accel_bias;
  found.start->sigma = sigma;
  found.start->sigma.velocity = kFirstVelocitySigma;
  return found;
}

std::size_t ImuStart::most_intervals(const ImuConfig& config) {
  return kMostWaits * static_cast<std::size_t>(config.moving_init_scans);
}

}  // namespace fdi_lio::odometry
