#include <random>

#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::imu {
namespace {

TEST(LevelOrientation, TurnsTheSpecificForceUpwardsWithoutYaw) {
  ImuStatistics statistics;
  statistics.count = 100;
  const Eigen::Quaterniond truth = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
                                   Eigen::Quaterniond(Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitX()));
  statistics.mean_acceleration = truth.conjugate() * Eigen::Vector3d(0.0, 0.0, 9.81);
  EXPECT_LT(level_orientation(statistics).angularDistance(truth), 1e-9);
}

TEST(IsStatic, NeedsTheFullTimeAndRest) {
  ImuConfig config;
  ImuStatistics statistics;
  statistics.duration_s = config.static_duration_s;
  statistics.count = 100;
  EXPECT_TRUE(is_static(statistics, config));
  statistics.duration_s = 0.3;
  EXPECT_FALSE(is_static(statistics, config));
  statistics.duration_s = config.static_duration_s;
  statistics.angular_velocity_std = 2.0 * config.static_gyro_std;
  EXPECT_FALSE(is_static(statistics, config));
}

TEST(AlignInMotion, FindsGravityBiasAndVelocityInATiltedFrame) {
  SyntheticMotion motion;
  motion.gravity = so3::exp(Eigen::Vector3d(0.1, -0.2, 0.0)) * Eigen::Vector3d(0.0, 0.0, -9.81);
  const Eigen::Vector3d gyro_bias(0.01, -0.02, 0.005);
  constexpr double kAccelBias = 0.2;  // upwards
  std::vector<AlignmentInterval> intervals;
  for (int k = 0; k < 20; ++k) {
    auto samples = motion.samples(0.1 * k, 0.1 * (k + 1), 200.0);
    for (ImuSample& sample : samples) {
      sample.angular_velocity += gyro_bias;
      sample.acceleration -=
          kAccelBias * (motion.attitude(0.1 * k).conjugate() * motion.gravity.normalized());
    }
    const Preintegration p =
        preintegrate(samples, samples.front().stamp, samples.back().stamp, {}, ImuNoise(), ImuConfig());
    intervals.push_back({motion.attitude(0.1 * (k + 1)), motion.position(0.1 * (k + 1)), p});
  }
  const auto result = align_in_motion(motion.attitude(0.0), motion.position(0.0), intervals, 9.81);
  ASSERT_TRUE(result.has_value());
  EXPECT_LT((result->gyro_bias - gyro_bias).norm(), 1e-3);
  EXPECT_LT((result->g_odom - motion.gravity).norm(), 0.05);
  EXPECT_LT((result->v_first - motion.velocity(0.0)).norm(), 0.05);
  EXPECT_LT((result->v_odom - motion.velocity(2.0)).norm(), 0.05);
  EXPECT_NEAR(result->gravity_error_mps2, kAccelBias, 0.05);
  const Eigen::Vector3d up_imu = -(motion.attitude(2.0).conjugate() * motion.gravity.normalized());
  EXPECT_LT((result->accel_bias - kAccelBias * up_imu).norm(), 0.05);
}

/// How far gravity is off over many runs is what each of them says.
TEST(AlignInMotion, TheStatedDeviationOfGravityIsTheTrueOne) {
  constexpr int kRuns = 300;
  constexpr double kScatter_m = 0.05;
  SyntheticMotion motion;
  motion.gravity = Eigen::Vector3d(0.0, 0.0, -9.81);
  std::vector<AlignmentInterval> exact;
  for (int k = 0; k < 20; ++k) {
    const auto samples = motion.samples(0.1 * k, 0.1 * (k + 1), 200.0);
    const Preintegration p =
        preintegrate(samples, samples.front().stamp, samples.back().stamp, {}, ImuNoise(), ImuConfig());
    exact.push_back({motion.attitude(0.1 * (k + 1)), motion.position(0.1 * (k + 1)), p});
  }
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, kScatter_m);
  const auto scattered = [&](const Eigen::Vector3d& t) {
    return Eigen::Vector3d(t + Eigen::Vector3d(noise(random), noise(random), noise(random)));
  };
  double squared_errors = 0.0;
  double stated_variances = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    std::vector<AlignmentInterval> intervals = exact;
    for (AlignmentInterval& interval : intervals) interval.t_odom_imu = scattered(interval.t_odom_imu);
    const auto result =
        align_in_motion(motion.attitude(0.0), scattered(motion.position(0.0)), intervals, 9.81);
    ASSERT_TRUE(result);
    squared_errors += (result->g_odom - motion.gravity).head<2>().squaredNorm() / 2.0;
    stated_variances += result->gravity_sigma_mps2 * result->gravity_sigma_mps2;
  }
  // Stated is the worst of three axes: by chance alone that is up to 1.3 times the usual one.
  const double ratio = std::sqrt(stated_variances / squared_errors);
  EXPECT_GT(ratio, 0.9);
  EXPECT_LT(ratio, 1.4);
}

TEST(AlignInMotion, RefusesTooFewIntervals) {
  EXPECT_FALSE(
      align_in_motion(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), {}, 9.81).has_value());
}

}  // namespace
}  // namespace fdi_lio::imu
