#include <gtest/gtest.h>

#include "fdi_lio/odometry/calibration_report.hpp"

namespace fdi_lio::odometry {
namespace {

TEST(CalibrationReport, SaysNothingWhileAllIsAsStated) {
  Reporter reporter;
  CalibrationReport report(SensorConfig(), &reporter);
  imu::NavState state;
  state.mounting = Eigen::Vector3d(0.003, 0.0, 0.0);
  state.lidar_time_offset_s = 0.002;
  for (int k = 0; k < 100; ++k) report.add(state, imu::ImuStatistics());
  EXPECT_TRUE(reporter.notices().empty());
}

TEST(CalibrationReport, NamesTheRotationThatFits) {
  Reporter reporter;
  CalibrationReport report(SensorConfig(), &reporter);
  imu::NavState state;
  state.mounting = Eigen::Vector3d(0.0, 0.0, 0.1);
  report.add(state, imu::ImuStatistics());
  ASSERT_TRUE(reporter.has("mounting"));
  EXPECT_NE(reporter.take_new().front().text.find("0.049979, 0.998750]"), std::string::npos);
}

TEST(CalibrationReport, NamesTheAxisOfTheGyroThatIsOff) {
  Reporter reporter;
  CalibrationReport report(SensorConfig(), &reporter);
  imu::NavState state;
  state.gyro_scale(1, 1) = -0.02;
  report.add(state, imu::ImuStatistics());
  EXPECT_FALSE(reporter.has("gyro_scale"));
  state.gyro_scale(1, 1) = -0.04;
  report.add(state, imu::ImuStatistics());
  ASSERT_TRUE(reporter.has("gyro_scale"));
  EXPECT_NE(reporter.take_new().front().text.find("its y axis 4.0 % too small"), std::string::npos);
}

TEST(CalibrationReport, AnOffsetIsNamedOnceItHasSettled) {
  Reporter reporter;
  SensorConfig sensor;
  sensor.lidar_time_offset_s = 0.5;
  CalibrationReport report(sensor, &reporter);
  imu::NavState state;
  for (int k = 0; k < 60; ++k) {
    state.lidar_time_offset_s = 0.001 * k;
    report.add(state, imu::ImuStatistics());
  }
  EXPECT_FALSE(reporter.has("time_offset"));
  for (int k = 0; k < 60; ++k) report.add(state, imu::ImuStatistics());
  ASSERT_TRUE(reporter.has("time_offset"));
  EXPECT_NE(reporter.take_new().front().text.find("sensor.lidar_time_offset to 0.5590"), std::string::npos);
}

TEST(CalibrationReport, VibrationIsNamed) {
  Reporter reporter;
  CalibrationReport report(SensorConfig(), &reporter);
  imu::ImuStatistics recent;
  recent.acceleration_noise = 0.02;
  report.add(imu::NavState(), recent);
  EXPECT_FALSE(reporter.has("imu_vibration"));
  recent.acceleration_noise = 0.2;
  report.add(imu::NavState(), recent);
  ASSERT_TRUE(reporter.has("imu_vibration"));
  EXPECT_NE(reporter.take_new().front().text.find("sensor.accel_noise (0.01)"), std::string::npos);
}

}  // namespace
}  // namespace fdi_lio::odometry
