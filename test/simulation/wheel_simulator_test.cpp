#include "fdi_lio/simulation/wheel_simulator.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::simulation {
namespace {

/// A bend of 30 m radius at 6 m/s, level.
Trajectory bend() {
  std::vector<PoseVector> poses;
  for (int i = 0; i < 200; ++i) {
    const double angle = 6.0 / 30.0 * 0.1 * i;
    PoseVector pose = PoseVector::Zero();
    pose[0] = 30.0 * std::sin(angle);
    pose[1] = 30.0 * (1.0 - std::cos(angle));
    pose[5] = angle;
    poses.push_back(pose);
  }
  return Trajectory(poses, 0.1);
}

WheelReading last_reading(const Trajectory& drive, const WheelSettings& settings, std::uint64_t seed) {
  WheelSimulator wheels(drive, settings, seed);
  WheelReading reading;
  while (reading.time_s < 15.0) reading = wheels.next();
  return reading;
}

WheelSettings perfect() {
  WheelSettings settings;
  settings.scale_error = settings.noise = settings.yaw_noise_deg = 0.0;
  return settings;
}

TEST(WheelSimulator, PerfectWheelsFollowALevelDrive) {
  const Trajectory drive = bend();
  const WheelReading reading = last_reading(drive, perfect(), 1);
  const Eigen::Isometry3d T_true = drive.pose(0.0).inverse() * drive.pose(reading.time_s);
  EXPECT_LT((reading.T_start_imu.translation() - T_true.translation()).norm(), 0.02);
  EXPECT_LT((reading.T_start_imu.linear() - T_true.linear()).norm(), 1e-3);
  EXPECT_NEAR(reading.speed_mps, 6.0, 0.01);
  EXPECT_NEAR(reading.yaw_rate_radps, 0.2, 1e-3);
}

TEST(WheelSimulator, ErrorsHaveTheirSizes) {
  const Trajectory drive = bend();
  WheelSettings scaled = perfect();
  scaled.scale_error = 0.02;
  WheelSettings turned = perfect();
  turned.yaw_noise_deg = 0.5;
  const Eigen::Matrix3d R_true = last_reading(drive, perfect(), 1).T_start_imu.linear();
  constexpr int kSeeds = 200;
  double speed_sq = 0.0, turn_sq = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    speed_sq += std::pow(last_reading(drive, scaled, seed).speed_mps / 6.0 - 1.0, 2);
    const Eigen::Matrix3d R = last_reading(drive, turned, seed).T_start_imu.linear();
    turn_sq += so3::log(Eigen::Matrix3d(R_true.transpose() * R)).squaredNorm();
  }
  // A standard deviation from 200 samples is known to 5 %.
  EXPECT_NEAR(std::sqrt(speed_sq / kSeeds), 0.02, 0.004);
  EXPECT_NEAR(std::sqrt(turn_sq / kSeeds), 0.5 * M_PI / 180.0 * std::sqrt(90.0), 0.016);
}

TEST(WheelSimulator, SeedsAreRepeatable) {
  const Trajectory drive = bend();
  const WheelSettings settings;
  EXPECT_EQ(last_reading(drive, settings, 5).T_start_imu.matrix(),
            last_reading(drive, settings, 5).T_start_imu.matrix());
  EXPECT_NE(last_reading(drive, settings, 5).T_start_imu.matrix(),
            last_reading(drive, settings, 6).T_start_imu.matrix());
}

}  // namespace
}  // namespace fdi_lio::simulation
