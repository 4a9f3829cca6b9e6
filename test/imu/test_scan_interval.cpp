#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/scan_interval.hpp"

namespace fdi_lio::imu {
namespace {

constexpr Stamp kMs = 1'000'000;

class ScanInterval : public testing::Test {
 protected:
  ScanInterval() {
    for (int k = 0; k <= 300; ++k) {
      ImuSample sample;
      sample.stamp = 10 * k * kMs;
      sample.acceleration.z() = 9.81;
      imu_.add(sample);
    }
  }

  Config config_;
  Reporter reporter_;
  ImuBuffer imu_{config_.sensor, &reporter_};
};

TEST_F(ScanInterval, BeginsAtTheNewestEstimate) {
  NavState state;
  state.stamp = 2000 * kMs;
  state.gyro_bias.x() = 0.01;
  const auto imu = preintegrate_scan_interval(imu_, state, std::nullopt, 2100 * kMs, config_);
  ASSERT_TRUE(imu);
  EXPECT_EQ(imu->from, state.stamp);
  EXPECT_EQ(imu->to, 2100 * kMs);
  EXPECT_EQ(imu->gyro_bias, state.gyro_bias);
}

TEST_F(ScanInterval, BeforeTheFirstEstimateCoversTheStretchOfTheStaticStart) {
  const auto imu = preintegrate_scan_interval(imu_, std::nullopt, std::nullopt, 2100 * kMs, config_);
  ASSERT_TRUE(imu);
  EXPECT_NEAR(seconds_between(imu->from, imu->to), config_.imu.static_duration_s, 1e-9);
}

TEST_F(ScanInterval, BeginsAtTheScanBeforeWhenItsEstimateIsStillToCome) {
  NavState state;
  state.stamp = 1500 * kMs;
  state.gyro_bias.x() = 0.01;
  const Stamp unanswered = 2000 * kMs;
  const auto imu = preintegrate_scan_interval(imu_, state, unanswered, 2100 * kMs, config_);
  ASSERT_TRUE(imu);
  EXPECT_EQ(imu->from, unanswered);
  EXPECT_EQ(imu->gyro_bias, state.gyro_bias);
  EXPECT_FALSE(preintegrate_scan_interval(ImuBuffer(config_.sensor, &reporter_), state, unanswered,
                                          2100 * kMs, config_));
}

TEST_F(ScanInterval, AStateIsCarriedOnByTheReadings) {
  const SyntheticMotion motion;
  ImuBuffer imu(config_.sensor, &reporter_);
  for (const ImuSample& sample : motion.samples(0.0, 5.0, 200.0)) imu.add(sample);
  const NavState after = motion.state(4.0);
  const NavState carried = carried_on(imu, motion.state(1.0), after.stamp, config_);
  EXPECT_EQ(carried.stamp, after.stamp);
  EXPECT_LT((carried.t_odom_imu - after.t_odom_imu).norm(), 0.01);
  EXPECT_LT((carried.v_odom - after.v_odom).norm(), 0.01);
  EXPECT_LT(carried.q_odom_imu.angularDistance(after.q_odom_imu), 1e-3);
}

TEST_F(ScanInterval, WithoutReadingsOrAnInitialisedImuAStateGoesOnAsItMoves) {
  const SyntheticMotion motion;
  NavState state = motion.state(1.0);
  const Stamp to = add_seconds(state.stamp, 0.5);
  const Eigen::Vector3d straight = state.t_odom_imu + 0.5 * state.v_odom;
  EXPECT_LT(
      (carried_on(ImuBuffer(config_.sensor, &reporter_), state, to, config_).t_odom_imu - straight).norm(),
      1e-9);
  ImuBuffer imu(config_.sensor, &reporter_);
  for (const ImuSample& sample : motion.samples(0.0, 5.0, 200.0)) imu.add(sample);
  state.imu_status = ImuStatus::kInitialising;
  EXPECT_LT((carried_on(imu, state, to, config_).t_odom_imu - straight).norm(), 1e-9);
}

}  // namespace
}  // namespace fdi_lio::imu
