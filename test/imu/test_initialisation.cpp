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
  std::vector<AlignmentInterval> intervals;
  for (int k = 0; k < 20; ++k) {
    auto samples = motion.samples(0.1 * k, 0.1 * (k + 1), 200.0);
    for (ImuSample& sample : samples) sample.angular_velocity += gyro_bias;
    const Preintegration p =
        preintegrate(samples, samples.front().stamp, samples.back().stamp, Eigen::Vector3d::Zero(),
                     Eigen::Vector3d::Zero(), ImuNoise(), ImuConfig());
    intervals.push_back({motion.attitude(0.1 * (k + 1)), motion.position(0.1 * (k + 1)), p});
  }
  const auto result = align_in_motion(motion.attitude(0.0), motion.position(0.0), intervals, 9.81);
  ASSERT_TRUE(result.has_value());
  EXPECT_LT((result->gyro_bias - gyro_bias).norm(), 1e-3);
  EXPECT_LT((result->g_odom - motion.gravity).norm(), 0.05);
  EXPECT_LT((result->v_odom - motion.velocity(2.0)).norm(), 0.05);
  EXPECT_LT(result->gravity_error_mps2, 0.05);
}

TEST(AlignInMotion, RefusesTooFewIntervals) {
  EXPECT_FALSE(
      align_in_motion(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), {}, 9.81).has_value());
}

}  // namespace
}  // namespace fdi_lio::imu
