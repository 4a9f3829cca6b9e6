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

}  // namespace
}  // namespace fdi_lio::imu
