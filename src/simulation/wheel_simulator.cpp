#include "fdi_lio/simulation/wheel_simulator.hpp"

#include <cmath>

#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/random_streams.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kDegree = M_PI / 180.0;

}  // namespace

WheelSimulator::WheelSimulator(const Trajectory& trajectory, const WheelSettings& settings,
                               std::uint64_t seed)
    : trajectory_(trajectory), settings_(settings), seed_(seed) {
  Random random(seed, kStreamWheels, ~std::uint64_t{0});
  scale_ = 1.0 + settings.scale_error * random.normal();
}

WheelReading WheelSimulator::next() {
  const double time_s = static_cast<double>(count_) / settings_.rate_hz;
  if (count_ > 0) {
    Random random(seed_, kStreamWheels, static_cast<std::uint64_t>(count_));
    const Eigen::Isometry3d T_step = trajectory_.pose(reading_.time_s).inverse() * trajectory_.pose(time_s);
    const double walk = std::sqrt(T_step.translation().norm());
    const double forward_m = scale_ * T_step.translation().x() + settings_.noise * walk * random.normal();
    const Eigen::Vector3d ahead = T_step.linear().col(0);
    const double turn_rad =
        std::atan2(ahead.y(), ahead.x()) + settings_.yaw_noise_deg * kDegree * walk * random.normal();
    // Along the chord of the arc.
    reading_.T_start_imu.rotate(Eigen::AngleAxisd(0.5 * turn_rad, Eigen::Vector3d::UnitZ()));
    reading_.T_start_imu.translate(Eigen::Vector3d(forward_m, 0.0, 0.0));
    reading_.T_start_imu.rotate(Eigen::AngleAxisd(0.5 * turn_rad, Eigen::Vector3d::UnitZ()));
    const double period_s = time_s - reading_.time_s;
    reading_.speed_mps = forward_m / period_s;
    reading_.yaw_rate_radps = turn_rad / period_s;
  }
  reading_.time_s = time_s;
  ++count_;
  return reading_;
}

}  // namespace fdi_lio::simulation
