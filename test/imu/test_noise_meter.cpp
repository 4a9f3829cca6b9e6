#include <cmath>
#include <random>

#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/imu/noise_meter.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::imu {
namespace {

constexpr double kAccel = 0.2;  // [m/s^2/sqrt(Hz)]
constexpr double kGyro = 0.01;  // [rad/s/sqrt(Hz)]

void add_white_noise(double rate_hz, std::mt19937* random, std::vector<ImuSample>* samples) {
  std::normal_distribution<double> normal;
  const double scale = std::sqrt(rate_hz);
  for (ImuSample& sample : *samples) {
    for (int axis = 0; axis < 3; ++axis) {
      sample.acceleration[axis] += kAccel * scale * normal(*random);
      sample.angular_velocity[axis] += kGyro * scale * normal(*random);
    }
  }
}

std::optional<NoiseMeter::Density> density_of(const std::vector<ImuSample>& samples) {
  NoiseMeter meter;
  for (const ImuSample& sample : samples) meter.add(sample);
  return meter.density();
}

TEST(NoiseMeter, FindsWhiteNoiseWhileTheSensorMoves) {
  std::mt19937 random(1);
  for (const double rate_hz : {100.0, 200.0, 400.0}) {
    double acceleration = 0.0;
    double angular_velocity = 0.0;
    constexpr int kRuns = 30;
    for (int run = 0; run < kRuns; ++run) {
      auto samples = SyntheticMotion().samples(run, run + 1.0, rate_hz);
      add_white_noise(rate_hz, &random, &samples);
      const auto density = density_of(samples);
      ASSERT_TRUE(density);
      acceleration += density->acceleration / kRuns;
      angular_velocity += density->angular_velocity / kRuns;
    }
    // The smaller of two estimates, each with a deviation of a tenth to a fifth, is a little too small.
    EXPECT_NEAR(acceleration, 0.92 * kAccel, 0.08 * kAccel) << rate_hz;
    EXPECT_NEAR(angular_velocity, 0.92 * kGyro, 0.08 * kGyro) << rate_hz;
  }
}

TEST(NoiseMeter, MotionIsNoNoise) {
  for (const double rate_hz : {50.0, 100.0, 200.0}) {
    const auto density = density_of(SyntheticMotion().samples(0.0, 1.0, rate_hz));
    ASSERT_TRUE(density);
    EXPECT_LT(density->acceleration, 1e-3);
    EXPECT_LT(density->angular_velocity, 1e-4);
  }
}

// 23 and 37 Hz at 3 m/s^2, which 100 readings a second show as strongly as white noise of 0.2 m/s^2/sqrt(Hz).
TEST(NoiseMeter, TheHumOfAnEngineIntegratesToNothing) {
  auto samples = SyntheticMotion().samples(0.0, 1.0, 100.0);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double t = 0.01 * static_cast<double>(k);
    samples[k].acceleration.x() += 3.0 * std::sin(2.0 * M_PI * 23.0 * t);
    samples[k].acceleration.z() += 3.0 * std::sin(2.0 * M_PI * 37.0 * t);
  }
  EXPECT_LT(density_of(samples)->acceleration, 0.04);
}

TEST(NoiseMeter, FewReadingsAndGapsSayNothing) {
  EXPECT_FALSE(density_of(SyntheticMotion().samples(0.0, 0.3, 100.0)));
  auto samples = SyntheticMotion().samples(0.0, 1.0, 100.0);
  for (std::size_t k = 0; k < samples.size(); k += 3) samples[k].stamp += to_nanoseconds(0.005);
  EXPECT_FALSE(density_of(samples));
}

TEST(NoiseOf, IsWhatTheReadingsShowWhereThatIsMore) {
  const SensorConfig sensor;
  ImuStatistics recent;
  EXPECT_EQ(noise_of(sensor, recent).accel, sensor.accel_noise);
  EXPECT_EQ(noise_of(sensor, recent).gyro, sensor.gyro_noise);
  EXPECT_FALSE(is_shaken(sensor, recent));
  recent.acceleration_noise = 0.2 * sensor.accel_noise;
  recent.angular_velocity_noise = 0.2 * sensor.gyro_noise;
  EXPECT_EQ(noise_of(sensor, recent).accel, sensor.accel_noise);
  EXPECT_EQ(noise_of(sensor, recent).gyro, sensor.gyro_noise);
  recent.acceleration_noise = 10.0 * sensor.accel_noise;
  EXPECT_NEAR(noise_of(sensor, recent).accel, 30.0 * sensor.accel_noise, 1e-12);
  EXPECT_EQ(noise_of(sensor, recent).gyro, sensor.gyro_noise);
  EXPECT_TRUE(is_shaken(sensor, recent));
}

/// Statistics of a sensor that does not move, or that sways by `sway` [m/s^2] at 1 Hz, beside an engine.
ImuStatistics shaken(double sway, std::mt19937* random) {
  std::vector<ImuSample> samples;
  for (int k = 0; k < 100; ++k) {
    ImuSample sample;
    sample.stamp = to_nanoseconds(0.01 * k);
    sample.acceleration = Eigen::Vector3d(sway * std::sin(0.02 * M_PI * k), 0.0, 9.81);
    samples.push_back(sample);
  }
  add_white_noise(100.0, random, &samples);
  Reporter reporter;
  ImuBuffer buffer(SensorConfig(), &reporter);
  for (const ImuSample& sample : samples) buffer.add(sample);
  return buffer.statistics(buffer.newest(), 1.0);
}

TEST(IsStatic, AnEngineMayRun) {
  std::mt19937 random(3);
  int still = 0;
  int swaying = 0;
  for (int run = 0; run < 100; ++run) {
    still += is_static(shaken(0.0, &random), ImuConfig()) ? 1 : 0;
    swaying += is_static(shaken(8.0, &random), ImuConfig()) ? 1 : 0;
  }
  EXPECT_GT(still, 70);  // and each scan asks again
  EXPECT_EQ(swaying, 0);
}

// A sensor that turns evenly tells nothing of the clocks, however noisy its readings are.
TEST(Preintegration, NoiseDoesNotTellTheTime) {
  std::mt19937 random(5);
  int told = 0;
  for (int run = 0; run < 100; ++run) {
    std::vector<ImuSample> samples;
    for (int k = 0; k <= 10; ++k) {
      ImuSample sample;
      sample.stamp = to_nanoseconds(0.01 * k);
      sample.angular_velocity = Eigen::Vector3d(0.0, 0.0, 0.5);
      samples.push_back(sample);
    }
    add_white_noise(100.0, &random, &samples);
    ImuNoise noise;
    noise.gyro_seen = kGyro;
    const Preintegration p =
        preintegrate(samples, samples.front().stamp, samples.back().stamp, {}, noise, ImuConfig());
    told += p.dq_doffset.norm() > 0.0 ? 1 : 0;
  }
  EXPECT_LT(told, 10);
}

}  // namespace
}  // namespace fdi_lio::imu
