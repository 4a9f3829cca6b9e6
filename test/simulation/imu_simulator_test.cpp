#include "fdi_lio/simulation/imu_simulator.hpp"

#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/simulation/route.hpp"

namespace fdi_lio::simulation {
namespace {

/// A second of dead reckoning from the true state: midpoint integration of bias-free readings.
struct Drift {
  double position_m = 0.0;
  double rotation_deg = 0.0;
};

class DeadReckoner {
 public:
  DeadReckoner(const MotionState& start, double gravity)
      : R_(start.T_map_imu.linear()),
        p_(start.T_map_imu.translation()),
        v_(start.v_map),
        g_(0.0, 0.0, -gravity) {}

  void step(const ImuReading& a, const ImuReading& b) {
    const double dt = b.time_s - a.time_s;
    const Eigen::Vector3d w = 0.5 * (a.gyro - a.true_gyro_bias + b.gyro - b.true_gyro_bias);
    const Eigen::Matrix3d R_end = R_ * so3::exp(w * dt);
    const Eigen::Vector3d acceleration =
        0.5 * (R_ * (a.accel - a.true_accel_bias) + R_end * (b.accel - b.true_accel_bias)) + g_;
    p_ += v_ * dt + 0.5 * acceleration * dt * dt;
    v_ += acceleration * dt;
    R_ = R_end;
  }

  Drift drift(const MotionState& truth) const {
    const Eigen::Matrix3d error = truth.T_map_imu.linear().transpose() * R_;
    return {(p_ - truth.T_map_imu.translation()).norm(), so3::log(error).norm() * 180.0 / M_PI};
  }

 private:
  Eigen::Matrix3d R_;
  Eigen::Vector3d p_, v_, g_;
};

Trajectory city_drive(const MotionSettings& motion) {
  const Route route({{0, 0}, {150, 0}, {150, 100}, {0, 100}}, 10.0, true);
  return drive(
      route, [](double x, double y) { return 0.5 * std::sin(0.03 * x + 0.02 * y); }, motion, 20.0, 40.0, 3);
}

Trajectory walk_with_shaking_hands() {
  MotionSettings motion;
  motion.type = "handheld";
  motion.speed_mps = 1.2;
  motion.shake_rad_s = 3.0;
  return city_drive(motion);
}

ImperfectionSettings perfect() {
  ImperfectionSettings settings;
  settings.enabled = false;
  return settings;
}

Drift worst_drift(const Trajectory& trajectory, const ImuSettings& settings, std::uint64_t seed) {
  ImuSimulator imu(trajectory, settings, perfect(), seed);
  Drift worst;
  ImuReading previous = imu.next();
  for (int second = 0; second < 35; ++second) {
    DeadReckoner reckoner(trajectory.evaluate(previous.time_s), settings.gravity_mps2);
    for (int i = 0; i < static_cast<int>(settings.rate_hz); ++i) {
      const ImuReading reading = imu.next();
      reckoner.step(previous, reading);
      previous = reading;
    }
    const Drift drift = reckoner.drift(trajectory.evaluate(previous.time_s));
    worst.position_m = std::max(worst.position_m, drift.position_m);
    worst.rotation_deg = std::max(worst.rotation_deg, drift.rotation_deg);
  }
  return worst;
}

class ImuRates : public testing::TestWithParam<double> {};

TEST_P(ImuRates, IntegratedOverASecondFollowTheTruth) {
  ImuSettings settings;
  settings.rate_hz = GetParam();
  const Trajectory trajectory = city_drive(MotionSettings());
  const Drift drift = worst_drift(trajectory, settings, 11);
  std::printf("worst of 35 s at %.0f Hz: %.4f m, %.4f deg\n", settings.rate_hz, drift.position_m,
              drift.rotation_deg);
  EXPECT_LT(drift.position_m, 0.01);
  EXPECT_LT(drift.rotation_deg, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Rates, ImuRates, testing::Values(100.0, 200.0, 400.0));

TEST(ImuSimulator, HandHeldMotionFollowsTheTruth) {
  const Trajectory trajectory = walk_with_shaking_hands();
  double peak = 0.0;
  for (double t = 0.0; t < 40.0; t += 0.01) peak = std::max(peak, trajectory.evaluate(t).w_imu.norm());
  EXPECT_GT(peak, 2.0);
  EXPECT_LT(peak, 4.0);
  ImuSettings settings;
  settings.rate_hz = 200.0;
  const Drift drift = worst_drift(trajectory, settings, 12);
  std::printf("hand-held, worst of 35 s: %.4f m, %.4f deg, peak rate %.2f rad/s\n", drift.position_m,
              drift.rotation_deg, peak);
  EXPECT_LT(drift.position_m, 0.01);
  EXPECT_LT(drift.rotation_deg, 0.05);
}

// Rates of a gyro whose axes are wrong are a linear map of the true ones, with entries of the sizes asked
// for.
TEST(ImuSimulator, ScalesAndAxesHaveTheSizesThatWereAskedFor) {
  const Trajectory trajectory = walk_with_shaking_hands();
  ImuSettings settings;
  settings.gyro_noise = settings.accel_noise = settings.gyro_bias = settings.accel_bias = 0.0;
  settings.gyro_bias_walk = settings.accel_bias_walk = 0.0;
  ImperfectionSettings sizes;
  sizes.gyro_scale = 0.01;
  sizes.accel_scale = 0.005;
  sizes.imu_axes_deg = 0.3;
  double gyro = 0.0, accel = 0.0, lean = 0.0;
  constexpr int kUnits = 100;
  for (int seed = 0; seed < kUnits; ++seed) {
    ImuSimulator imu(trajectory, settings, sizes, static_cast<std::uint64_t>(seed));
    Eigen::Matrix3d gyro_sum = Eigen::Matrix3d::Zero(), w_sum = gyro_sum, accel_sum = gyro_sum,
                    f_sum = gyro_sum;
    for (int i = 0; i < 1000; ++i) {
      const ImuReading reading = imu.next();
      const MotionState truth = trajectory.evaluate(reading.time_s);
      const Eigen::Vector3d f = truth.T_map_imu.linear().transpose() *
                                (truth.a_map + Eigen::Vector3d(0.0, 0.0, settings.gravity_mps2));
      gyro_sum += reading.gyro * truth.w_imu.transpose();
      w_sum += truth.w_imu * truth.w_imu.transpose();
      accel_sum += reading.accel * f.transpose();
      f_sum += f * f.transpose();
    }
    const Eigen::Matrix3d gyro_error = gyro_sum * w_sum.inverse() - Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d accel_error = accel_sum * f_sum.inverse() - Eigen::Matrix3d::Identity();
    EXPECT_LT((imu.axes().gyro - Eigen::Matrix3d::Identity() - gyro_error).norm(), 1e-9);
    EXPECT_LT((imu.axes().accel - Eigen::Matrix3d::Identity() - accel_error).norm(), 1e-9);
    const ImuReading last = imu.next();
    const Eigen::Vector3d w = trajectory.evaluate(last.time_s).w_imu;
    EXPECT_LT((last.gyro - w - gyro_error * w).norm(), 1e-9);
    gyro += gyro_error.diagonal().squaredNorm() / (3.0 * kUnits);
    accel += accel_error.diagonal().squaredNorm() / (3.0 * kUnits);
    for (const Eigen::Matrix3d& error : {gyro_error, accel_error})
      lean += (error.squaredNorm() - error.diagonal().squaredNorm()) / (12.0 * kUnits);
  }
  EXPECT_NEAR(std::sqrt(gyro), sizes.gyro_scale, 0.1 * sizes.gyro_scale);
  EXPECT_NEAR(std::sqrt(accel), sizes.accel_scale, 0.1 * sizes.accel_scale);
  EXPECT_NEAR(std::sqrt(lean) * 180.0 / M_PI, sizes.imu_axes_deg, 0.1 * sizes.imu_axes_deg);
}

TEST(ImuSimulator, NoiseHasTheDensityThatWasAskedFor) {
  ImuSettings settings;
  settings.rate_hz = 200.0;
  MotionSettings motion;
  motion.stand_s = 60.0;
  const Trajectory trajectory = city_drive(motion);
  ImuSimulator imu(trajectory, settings, perfect(), 4);
  double gyro = 0.0, accel = 0.0;
  constexpr int kCount = 6000;
  for (int i = 0; i < kCount; ++i) {
    const ImuReading reading = imu.next();
    gyro += (reading.gyro - reading.true_gyro_bias).squaredNorm() / (3.0 * kCount);
    const Eigen::Matrix3d R = trajectory.pose(reading.time_s).linear();
    const Eigen::Vector3d up = R.transpose() * Eigen::Vector3d(0.0, 0.0, settings.gravity_mps2);
    accel += (reading.accel - reading.true_accel_bias - up).squaredNorm() / (3.0 * kCount);
  }
  EXPECT_NEAR(std::sqrt(gyro), settings.gyro_noise * std::sqrt(200.0),
              0.05 * settings.gyro_noise * std::sqrt(200.0));
  EXPECT_NEAR(std::sqrt(accel), settings.accel_noise * std::sqrt(200.0),
              0.05 * settings.accel_noise * std::sqrt(200.0));
}

}  // namespace
}  // namespace fdi_lio::simulation
