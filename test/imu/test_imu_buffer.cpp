#include <limits>

#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/imu/imu_buffer.hpp"

namespace fdi_lio::imu {
namespace {

class Buffer : public testing::Test {
 protected:
  ImuSample at(double t) const { return SyntheticMotion().sample(t); }
  std::uint64_t count(const std::string& key) const {
    return reporter_.has(key) ? reporter_.notices().at(key).count : 0;
  }

  Reporter reporter_;
  SensorConfig sensor_;
};

TEST_F(Buffer, DropsAndCountsNanRepeatedAndLateReadings) {
  ImuBuffer buffer(sensor_, &reporter_);
  EXPECT_EQ(buffer.add(at(1.0)), StampVerdict::kAccept);
  EXPECT_EQ(buffer.add(at(1.0)), StampVerdict::kDrop);
  EXPECT_EQ(buffer.add(at(0.9)), StampVerdict::kDrop);
  ImuSample nan = at(1.1);
  nan.acceleration.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(buffer.add(nan), StampVerdict::kDrop);
  EXPECT_EQ(buffer.samples().size(), 1U);
  EXPECT_EQ(count("imu_order"), 2U);
  EXPECT_EQ(count("imu_non_finite"), 1U);
}

TEST_F(Buffer, DropsAndCountsWhatNoSensorMeasures) {
  ImuBuffer buffer(sensor_, &reporter_);
  ImuSample glitch = at(0.9);
  glitch.acceleration.x() = 1e6;
  EXPECT_EQ(buffer.add(glitch), StampVerdict::kDrop);
  EXPECT_EQ(buffer.add(at(1.0)), StampVerdict::kAccept);
  glitch = at(1.1);
  glitch.angular_velocity.z() = -101.0;
  EXPECT_EQ(buffer.add(glitch), StampVerdict::kDrop);
  glitch.angular_velocity.z() = -99.0;
  EXPECT_EQ(buffer.add(glitch), StampVerdict::kAccept);
  EXPECT_EQ(count("imu_limit"), 2U);
  EXPECT_NE(reporter_.notices().at("imu_limit").text.find("sensor.max_angular_rate"), std::string::npos);
}

TEST_F(Buffer, LimitsAreInMetresPerSecondSquaredWhateverTheUnit) {
  sensor_.max_acceleration_mps2 = 100.0;
  for (const char* unit : {"g", "auto"}) {
    sensor_.acceleration_unit = unit;
    ImuBuffer buffer(sensor_, &reporter_);
    ImuSample sample;
    sample.acceleration.z() = 1e6;  // must not teach `auto` the unit
    EXPECT_EQ(buffer.add(sample), StampVerdict::kDrop) << unit;
    sample.acceleration.z() = 1.0;
    EXPECT_EQ(buffer.add(sample), StampVerdict::kAccept) << unit;
    sample.stamp = to_nanoseconds(0.01);
    sample.acceleration.z() = 10.3;  // 101 m/s^2
    EXPECT_EQ(buffer.add(sample), StampVerdict::kDrop) << unit;
    sample.acceleration.z() = 10.1;
    EXPECT_EQ(buffer.add(sample), StampVerdict::kAccept) << unit;
  }
}

TEST_F(Buffer, OneStampFarAwayCostsOneReading) {
  for (const double wrong : {3600.0, -3600.0}) {
    ImuBuffer buffer(sensor_, &reporter_);
    EXPECT_EQ(buffer.add(at(100.0)), StampVerdict::kAccept);
    EXPECT_EQ(buffer.add(at(100.01 + wrong)), StampVerdict::kDrop);
    EXPECT_EQ(buffer.add(at(100.02)), StampVerdict::kAccept);
    EXPECT_EQ(buffer.samples().size(), 2U);
    EXPECT_EQ(buffer.newest(), at(100.02).stamp);
  }
  EXPECT_EQ(count("imu_order"), 2U);
  EXPECT_EQ(count("imu_restart"), 0U);
}

TEST_F(Buffer, AConfirmedJumpClearsTheBuffer) {
  for (const double jump : {3600.0, -99.0}) {
    ImuBuffer buffer(sensor_, &reporter_);
    buffer.add(at(100.0));
    EXPECT_EQ(buffer.add(at(100.0 + jump)), StampVerdict::kDrop);
    EXPECT_EQ(buffer.add(at(100.01 + jump)), StampVerdict::kRestart);
    EXPECT_EQ(buffer.newest(), at(100.01 + jump).stamp);
    EXPECT_EQ(buffer.samples().size(), 1U);
  }
  EXPECT_EQ(count("imu_restart"), 2U);
}

TEST_F(Buffer, ScalesReadingsInG) {
  for (const char* unit : {"g", "auto"}) {
    sensor_.acceleration_unit = unit;
    ImuBuffer buffer(sensor_, &reporter_);
    ImuSample sample;
    sample.acceleration = Eigen::Vector3d(0.0, 0.0, 1.0);
    buffer.add(sample);
    EXPECT_NEAR(buffer.samples().back().acceleration.z(), 9.80665, 1e-9) << unit;
  }
}

TEST_F(Buffer, WarnsWhenReadingsLookLikeG) {
  ImuBuffer buffer(sensor_, &reporter_);
  ImuSample sample;
  sample.acceleration = Eigen::Vector3d(0.0, 0.0, 1.0);
  buffer.add(sample);
  EXPECT_EQ(count("imu_unit"), 1U);
}

TEST_F(Buffer, BetweenIncludesTheReadingsThatBound) {
  ImuBuffer buffer(sensor_, &reporter_);
  for (int k = 0; k <= 10; ++k) buffer.add(at(0.1 * k));
  const auto readings = buffer.between(to_nanoseconds(100.25), to_nanoseconds(100.55), 0.0);
  ASSERT_EQ(readings.size(), 5U);
  EXPECT_EQ(readings.front().stamp, at(0.2).stamp);
  EXPECT_EQ(readings.back().stamp, at(0.6).stamp);
}

TEST_F(Buffer, BetweenIsInTheClockOfTheScans) {
  ImuBuffer buffer(sensor_, &reporter_);
  EXPECT_FALSE(buffer.reaches(0, 0.0));
  for (int k = 0; k <= 10; ++k) {
    ImuSample sample = at(0.1 * k);
    sample.angular_velocity.z() = 0.1 * k;
    buffer.add(sample);
  }
  constexpr double kOffset = 0.2;
  const auto readings = buffer.between(to_nanoseconds(100.25), to_nanoseconds(100.55), kOffset);
  ASSERT_EQ(readings.size(), 5U);
  EXPECT_EQ(readings.front().stamp, at(0.2).stamp);
  EXPECT_NEAR(readings.front().angular_velocity.z(), 0.2 + kOffset, 1e-12);
  EXPECT_NEAR(readings.back().angular_velocity.z(), 0.6 + kOffset, 1e-12);
  EXPECT_TRUE(buffer.reaches(at(0.8).stamp, kOffset));
  EXPECT_FALSE(buffer.reaches(at(0.81).stamp, kOffset));
  EXPECT_TRUE(buffer.reaches(at(1.2).stamp, -kOffset));
}

TEST_F(Buffer, StatisticsAreMeanAndDeviation) {
  ImuBuffer buffer(sensor_, &reporter_);
  for (int k = 0; k < 4; ++k) {
    ImuSample sample;
    sample.stamp = to_nanoseconds(1.0 + 0.1 * k);
    sample.acceleration = Eigen::Vector3d(0.0, 0.0, k % 2 == 0 ? 9.0 : 11.0);
    sample.angular_velocity = Eigen::Vector3d(0.1, 0.0, 0.0);
    buffer.add(sample);
  }
  const ImuStatistics statistics = buffer.statistics(to_nanoseconds(2.0), 1.5);
  EXPECT_EQ(statistics.count, 4U);
  EXPECT_NEAR(statistics.mean_acceleration.z(), 10.0, 1e-12);
  EXPECT_NEAR(statistics.acceleration_std, 1.0, 1e-12);
  EXPECT_NEAR(statistics.angular_velocity_std, 0.0, 1e-9);
  EXPECT_NEAR(statistics.duration_s, 0.3, 1e-9);
}

}  // namespace
}  // namespace fdi_lio::imu
