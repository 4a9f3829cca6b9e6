#include "fdi_lio/simulation/imu_simulator.hpp"

#include <cmath>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/random_streams.hpp"

namespace fdi_lio::simulation {

namespace {

Eigen::Vector3d random_vector(double sigma, Random* random) {
  const double x = random->normal();
  const double y = random->normal();
  const double z = random->normal();
  return sigma * Eigen::Vector3d(x, y, z);
}

/// Scale errors on the diagonal, what the axes lean towards each other beside it.
Eigen::Matrix3d random_axes(double scale, double lean_rad, Random* random) {
  Eigen::Matrix3d axes;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) {
      axes(row, col) = row == col ? 1.0 + scale * random->normal() : lean_rad * random->normal();
    }
  }
  return axes;
}

}  // namespace

ImuSimulator::ImuSimulator(const Trajectory& trajectory, const ImuSettings& settings,
                           const ImperfectionSettings& imperfections, std::uint64_t seed)
    : trajectory_(trajectory), settings_(settings), seed_(seed) {
  Random random(seed, kStreamImuBias);
  gyro_bias_ = random_vector(settings.gyro_bias, &random);
  accel_bias_ = random_vector(settings.accel_bias, &random);
  if (!imperfections.enabled) return;
  Random random_of_axes(seed, kStreamImuAxes);
  const double lean_rad = imperfections.imu_axes_deg * M_PI / 180.0;
  axes_.gyro = random_axes(imperfections.gyro_scale, lean_rad, &random_of_axes);
  axes_.accel = random_axes(imperfections.accel_scale, lean_rad, &random_of_axes);
}

ImuReading ImuSimulator::next() {
  constexpr double kOrientationNoiseRad = 0.005;  // of a 9-axis unit's own filter
  Random random(seed_, kStreamImu, static_cast<std::uint64_t>(count_));
  const double root_rate = std::sqrt(settings_.rate_hz);
  ImuReading reading;
  reading.time_s = static_cast<double>(count_) / settings_.rate_hz;
  const MotionState state = trajectory_.evaluate(reading.time_s);
  const Eigen::Vector3d gravity_map(0.0, 0.0, -settings_.gravity_mps2);
  reading.true_gyro_bias = gyro_bias_;
  reading.true_accel_bias = accel_bias_;
  reading.gyro =
      axes_.gyro * state.w_imu + gyro_bias_ + random_vector(settings_.gyro_noise * root_rate, &random);
  reading.accel = axes_.accel * (state.T_map_imu.linear().transpose() * (state.a_map - gravity_map)) +
                  accel_bias_ + random_vector(settings_.accel_noise * root_rate, &random);
  reading.orientation =
      Eigen::Quaterniond(state.T_map_imu.linear()) * so3::exp_q(random_vector(kOrientationNoiseRad, &random));
  gyro_bias_ += random_vector(settings_.gyro_bias_walk / root_rate, &random);
  accel_bias_ += random_vector(settings_.accel_bias_walk / root_rate, &random);
  ++count_;
  return reading;
}

}  // namespace fdi_lio::simulation
