#pragma once

#include <cmath>
#include <vector>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// A motion with known derivatives: sinusoids in position, a turn about a slowly moving axis in attitude.
struct SyntheticMotion {
  Eigen::Vector3d gravity = Eigen::Vector3d(0.0, 0.0, -9.81);
  Eigen::Vector3d mounting = Eigen::Vector3d::Zero();  ///< of the IMU in the axes of the pose

  static Eigen::Vector3d position(double t) {
    return {2.0 * std::sin(t), 1.5 * std::cos(0.7 * t), 0.3 * std::sin(1.3 * t)};
  }
  static Eigen::Vector3d velocity(double t) {
    return {2.0 * std::cos(t), -1.05 * std::sin(0.7 * t), 0.39 * std::cos(1.3 * t)};
  }
  static Eigen::Vector3d acceleration(double t) {
    return {-2.0 * std::sin(t), -0.735 * std::cos(0.7 * t), -0.507 * std::sin(1.3 * t)};
  }
  /// Product of two plain rotations: rates are known in closed form.
  static Eigen::Quaterniond attitude(double t) {
    return so3::exp_q(Eigen::Vector3d(0.0, 0.0, 0.8 * t)) *
           so3::exp_q(Eigen::Vector3d(0.3 * std::sin(t), 0.0, 0.0));
  }
  static Eigen::Vector3d rate(double t) {
    const Eigen::Quaterniond roll = so3::exp_q(Eigen::Vector3d(0.3 * std::sin(t), 0.0, 0.0));
    return roll.conjugate() * Eigen::Vector3d(0.0, 0.0, 0.8) + Eigen::Vector3d(0.3 * std::cos(t), 0.0, 0.0);
  }

  ImuSample sample(double t) const {
    ImuSample sample;
    sample.stamp = to_nanoseconds(100.0 + t);
    const Eigen::Quaterniond q_imu_pose = so3::exp_q(mounting).conjugate();
    sample.angular_velocity = q_imu_pose * rate(t);
    sample.acceleration = q_imu_pose * (attitude(t).conjugate() * (acceleration(t) - gravity));
    return sample;
  }

  std::vector<ImuSample> samples(double begin, double end, double rate_hz) const {
    std::vector<ImuSample> out;
    for (int k = 0; begin + k / rate_hz <= end + 1e-9; ++k) out.push_back(sample(begin + k / rate_hz));
    return out;
  }

  NavState state(double t) const {
    NavState state;
    state.stamp = to_nanoseconds(100.0 + t);
    state.q_odom_imu = attitude(t);
    state.t_odom_imu = position(t);
    state.v_odom = velocity(t);
    state.g_odom = gravity;
    state.mounting = mounting;
    state.imu_status = ImuStatus::kInitialised;
    return state;
  }
};

}  // namespace fdi_lio::imu
