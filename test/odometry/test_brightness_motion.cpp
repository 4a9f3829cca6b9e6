#include <vector>

#include "synthetic_road.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/odometry/brightness_motion.hpp"

namespace fdi_lio::odometry {
namespace {

constexpr std::size_t kScans = 8;
constexpr double kSure = 2.0;
constexpr double kAccuracy = 0.2;  // [m/s]

/// Scans of a sensor that looks `yaw` to the left of its way, in axes that are turned so too.
std::vector<BrightScan> drive(const SyntheticRoad& road, double speed_mps, double yaw = 0.0,
                              const Eigen::Vector3d& v_deskew = Eigen::Vector3d::Zero()) {
  std::vector<BrightScan> scans;
  for (unsigned k = 0; k < kScans; ++k) {
    FeatureSet features = road.scan(SyntheticRoad::kPeriod_s * k, speed_mps, yaw, k);
    for (Point& point : features.planes)
      point.position += (static_cast<double>(point.time_s) * v_deskew).cast<float>();
    scans.push_back(bright_scan(features, Eigen::Matrix3d::Identity(), v_deskew));
  }
  return scans;
}

Eigen::Vector3d along(double speed_mps, double yaw) {
  return speed_mps * Eigen::Vector3d(std::cos(yaw), -std::sin(yaw), 0.0);
}

TEST(BrightnessMotion, FindsTheVelocityOnARoadWithTraffic) {
  for (const double speed : {7.0, 16.3, 31.0}) {
    for (const double yaw : {0.0, 0.6}) {
      const BrightnessMotion motion =
          find_brightness_motion(drive(SyntheticRoad(), speed, yaw), KnownMotion());
      EXPECT_LT((motion.velocity - along(speed, yaw)).norm(), kAccuracy) << speed << ", " << yaw;
      EXPECT_GT(motion.lead, kSure);
      EXPECT_FALSE(motion.is_known);
    }
  }
}

TEST(BrightnessMotion, KnowsWhatWasEstimatedRight) {
  KnownMotion known;
  known.way.x() = 19.0 * SyntheticRoad::kPeriod_s * (kScans - 1);
  const BrightnessMotion motion = find_brightness_motion(drive(SyntheticRoad(), 20.0), known);
  EXPECT_TRUE(motion.is_known);
  EXPECT_GT(motion.lead, kSure);
}

/// Surfaces beside the way say how fast the sensor moves across it.
TEST(BrightnessMotion, LooksAlongTheOpenDirectionOnly) {
  constexpr double kYaw = 0.6;
  const auto scans = drive(SyntheticRoad(), 16.3, kYaw);
  KnownMotion known;
  known.open_direction = along(1.0, kYaw);
  const BrightnessMotion motion = find_brightness_motion(scans, known);
  EXPECT_LT((motion.velocity - along(16.3, kYaw)).norm(), kAccuracy);
  EXPECT_GT(motion.lead, kSure);
  const Eigen::Vector3d across = Eigen::Vector3d::UnitZ().cross(along(1.0, kYaw));
  known.open_direction = across;
  known.way = SyntheticRoad::kPeriod_s * (kScans - 1) * along(5.0, kYaw);
  EXPECT_NEAR(find_brightness_motion(scans, known).velocity.dot(along(1.0, kYaw)), 5.0, 1e-6);
}

/// Most blocks see little of the walls, and all have a vote: the middle of the votes is off by 0.5 m/s.
TEST(BrightnessMotion, BetweenWallsAllPairsTellTheVelocity) {
  SyntheticRoad road;
  road.walls_m = 4.0;
  road.roughness = 0.2;
  KnownMotion known;
  known.open_direction = Eigen::Vector3d::UnitX();
  for (const double speed : {7.0, 16.3}) {
    const BrightnessMotion motion = find_brightness_motion(drive(road, speed), known);
    EXPECT_LT((motion.velocity - along(speed, 0.0)).norm(), 0.1) << speed;
    EXPECT_GT(motion.lead, kSure);
  }
}

TEST(BrightnessMotion, UndoesTheVelocityThatFeaturesWereDeskewedWith) {
  const auto scans = drive(SyntheticRoad(), 16.0, 0.0, Eigen::Vector3d(9.0, 4.0, 0.0));
  EXPECT_LT((find_brightness_motion(scans, KnownMotion()).velocity - along(16.0, 0.0)).norm(), kAccuracy);
}

TEST(BrightnessMotion, TakesAKnownAccelerationIntoAccount) {
  SyntheticRoad road;
  road.acceleration_mps2 = -5.0;
  auto scans = drive(road, 15.0);
  for (BrightScan& scan : scans) {
    const double time_s = seconds_between(scans.front().stamp, scan.stamp);
    scan.gained_mps = time_s * Eigen::Vector3d(-5.0, 0.0, 0.0);
    scan.gained_m = 0.5 * time_s * scan.gained_mps;
  }
  EXPECT_LT((find_brightness_motion(scans, KnownMotion()).velocity - along(15.0, 0.0)).norm(), kAccuracy);
}

TEST(BrightnessMotion, AtRestNothingIsSurelyInMotion) {
  const BrightnessMotion motion = find_brightness_motion(drive(SyntheticRoad(), 0.0), KnownMotion());
  EXPECT_TRUE(motion.is_known || motion.lead < kSure) << motion.velocity.transpose();
}

TEST(BrightnessMotion, APlainRoadSaysNothing) {
  SyntheticRoad road;
  road.roughness = 0.0;
  EXPECT_LT(find_brightness_motion(drive(road, 20.0), KnownMotion()).lead, kSure);
}

TEST(BrightnessMotion, SensorsWithoutIntensitySayNothing) {
  std::vector<BrightScan> scans;
  for (unsigned k = 0; k < kScans; ++k) {
    FeatureSet features = SyntheticRoad().scan(SyntheticRoad::kPeriod_s * k, 20.0, 0.0, k);
    for (Point& point : features.planes) point.intensity = 0.0F;
    scans.push_back(bright_scan(features, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()));
  }
  EXPECT_LT(find_brightness_motion(scans, KnownMotion()).lead, kSure);
}

TEST(BrightnessOffset, FindsWhatAVelocityIsOffBy) {
  for (const double yaw : {0.0, 0.6}) {
    const auto scans = drive(SyntheticRoad(), 16.3, yaw);
    for (const double offset : {-1.5, 0.0, 0.7}) {
      const BrightnessOffset found =
          find_brightness_offset(scans, along(16.3 - offset, yaw), along(1.0, yaw));
      EXPECT_NEAR(found.mean_mps, offset, 0.25) << yaw;
      EXPECT_LT(found.variance, 0.25);
    }
  }
}

/// Then it is anywhere between -3 and 3 m/s, in 31 steps.
TEST(BrightnessOffset, APlainRoadSaysNothing) {
  SyntheticRoad road;
  road.roughness = 0.0;
  road.with_traffic = false;
  const BrightnessOffset found =
      find_brightness_offset(drive(road, 16.3), along(15.3, 0.0), Eigen::Vector3d::UnitX());
  EXPECT_NEAR(found.mean_mps, 0.0, 0.6);
  EXPECT_NEAR(std::sqrt(found.variance), 3.1 / std::sqrt(3.0), 0.3);
}

TEST(BrightnessMotion, ScansWithoutPointsSayNothing) {
  std::vector<BrightScan> scans(kScans);
  for (std::size_t k = 0; k < kScans; ++k) scans[k].stamp = static_cast<Stamp>(100000000 * k);
  EXPECT_LE(find_brightness_motion(scans, KnownMotion()).lead, 0.0);
}

/// What range and ring do to the brightness is no detail.
TEST(BrightScan, TakesOutWhatTravelsWithTheSensor) {
  SyntheticRoad road;
  road.roughness = 0.0;
  road.beam_error = 1.0;
  const BrightScan scan =
      bright_scan(road.scan(0.0, 0.0, 0.0, 1), Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero());
  ASSERT_GT(scan.points.size(), 1000U);
  double squares = 0.0;
  for (const BrightPoint& point : scan.points) squares += static_cast<double>(point.detail * point.detail);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(scan.points.size())), 0.1);
}

}  // namespace
}  // namespace fdi_lio::odometry
