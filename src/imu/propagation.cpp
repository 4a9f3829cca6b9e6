#include "fdi_lio/imu/propagation.hpp"

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/common/stamp_guard.hpp"

namespace fdi_lio::imu {

NavState step(const NavState& state, const ImuSample& before, const ImuSample& after) {
  const double dt = seconds_between(state.stamp, after.stamp);
  const ImuErrors errors = state.errors();
  const Eigen::Vector3d rate =
      errors.angular_velocity(0.5 * (before.angular_velocity + after.angular_velocity));
  const Eigen::Quaterniond q_pose_imu = so3::exp_q(state.mounting);
  const Eigen::Quaterniond q_imu = state.q_odom_imu * q_pose_imu;
  NavState next = state;
  next.stamp = after.stamp;
  next.q_odom_imu = (q_imu * so3::exp_q(dt * rate) * q_pose_imu.conjugate()).normalized();
  next.w_imu = errors.angular_velocity(after.angular_velocity);
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
  if (state.imu_status == ImuStatus::kInitialised) {
    const Eigen::Vector3d force = 0.5 * (before.acceleration + after.acceleration) - state.accel_bias;
    acceleration = q_imu * so3::exp_q(0.5 * dt * rate) * force + state.g_odom;
  }
  next.t_odom_imu += dt * state.v_odom + 0.5 * dt * dt * acceleration;
  next.v_odom += dt * acceleration;
  return next;
}

NavState coast(const NavState& state, Stamp to) {
  const double dt = seconds_between(state.stamp, to);
  NavState next = state;
  next.stamp = to;
  next.t_odom_imu += dt * state.v_odom;
  const Eigen::Vector3d w_pose = so3::exp_q(state.mounting) * state.w_imu;
  next.q_odom_imu = (state.q_odom_imu * so3::exp_q(dt * w_pose)).normalized();
  return next;
}

std::vector<NavState> propagate(const NavState& from, const std::vector<ImuSample>& samples, Stamp to) {
  std::vector<NavState> states{from};
  const ImuSample* before = nullptr;
  for (const ImuSample& sample : samples) {
    if (sample.stamp <= from.stamp) {
      before = &sample;
      continue;
    }
    ImuSample after = sample;
    if (before == nullptr) before = &sample;
    if (sample.stamp > to) {
      // The last interval ends at `to`, with the reading interpolated there.
      const double span = seconds_between(before->stamp, sample.stamp);
      const double ratio = span > 0.0 ? seconds_between(before->stamp, to) / span : 1.0;
      after.stamp = to;
      after.acceleration = before->acceleration + ratio * (sample.acceleration - before->acceleration);
      after.angular_velocity =
          before->angular_velocity + ratio * (sample.angular_velocity - before->angular_velocity);
    }
    if (states.back().stamp < after.stamp) states.push_back(step(states.back(), *before, after));
    before = &sample;
    if (sample.stamp >= to) break;
  }
  if (states.back().stamp < to) states.push_back(coast(states.back(), to));
  return states;
}

void ImuPropagator::set_state(const NavState& state, const ImuBuffer& buffer) {
  reset();
  if (!buffer.empty() && is_jump(state.stamp, buffer.newest())) return;
  state_ = state;
  state_->stamp = add_seconds(state.stamp, state.lidar_time_offset_s);
  if (buffer.empty() || buffer.newest() <= state_->stamp) return;
  state_ = propagate(*state_, buffer.between(state_->stamp, buffer.newest(), 0.0), buffer.newest()).back();
  last_sample_ = buffer.samples().back();
}

std::optional<NavState> ImuPropagator::add(const ImuSample& sample) {
  if (!state_) return std::nullopt;
  if (sample.stamp > state_->stamp) state_ = step(*state_, last_sample_ ? *last_sample_ : sample, sample);
  last_sample_ = sample;
  return state_;
}

void ImuPropagator::reset() {
  state_.reset();
  last_sample_.reset();
}

}  // namespace fdi_lio::imu
