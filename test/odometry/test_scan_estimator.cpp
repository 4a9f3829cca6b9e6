#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "synthetic_road.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/estimator.hpp"
#include "fdi_lio/odometry/imu_start.hpp"
#include "fdi_lio/odometry/scan_estimator.hpp"

namespace fdi_lio::odometry {
namespace {

constexpr double kPeriod_s = 0.1;

/// A street whose fronts across the way all stand ahead to the left, where the sweep begins.
class Street {
 public:
  /// What is seen of the sweep that ends at `end_s` and at x = `here_m`, deskewed with `v_deskew` along x.
  FeatureSet scan(double end_s, double here_m, double speed_mps, double v_deskew_mps, unsigned seed) const {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::normal_distribution<double> noise(0.0, 0.01);
    FeatureSet features;
    features.stamp = static_cast<Stamp>(std::llround(1e9 * end_s));
    const auto add = [&](const Eigen::Vector3d& place) {
      // The sweep begins ahead and goes round to the left.
      const Eigen::Vector3d from_end(place.x() - here_m, place.y(), place.z());
      double azimuth = std::atan2(from_end.y(), from_end.x());
      if (azimuth < 0.0) azimuth += 2.0 * M_PI;
      Point point;
      point.time_s = static_cast<float>(kPeriod_s * (azimuth / (2.0 * M_PI) - 1.0));
      const Eigen::Vector3d error(noise(random), noise(random), noise(random));
      Eigen::Vector3d seen = from_end + error;
      seen.x() += (v_deskew_mps - speed_mps) * point.time_s;
      point.position = seen.cast<float>();
      features.planes.push_back(point);
    };
    for (int k = 0; k < 1200; ++k) {
      add({here_m - 20.0 + 40.0 * uniform(random), -5.0 + 13.0 * uniform(random), -1.7});
      add({here_m - 20.0 + 40.0 * uniform(random), -5.0, -1.7 + 4.0 * uniform(random)});
    }
    for (const double front : kFronts) {
      if (front < here_m + 8.0 || front > here_m + 25.0) continue;
      for (int k = 0; k < 120; ++k) add({front, 3.0 + 4.0 * uniform(random), -1.7 + 4.0 * uniform(random)});
    }
    return features;
  }

 private:
  static constexpr double kFronts[] = {9.3, 13.1, 16.4, 21.2, 24.0, 28.7, 32.9, 35.2};
};

/// Without an IMU the velocity of one scan deskews the next. The first two were not deskewed.
TEST(ScanEstimator, TheVelocityIsTheTrueOneFromTheSecondScanOn) {
  constexpr double kSpeed = 3.0;
  Reporter reporter;
  Estimator estimator(Config(), &reporter);
  for (int k = 0; k < 40; ++k) {
    const std::optional<imu::NavState> before = estimator.state();
    const double v_deskew = before ? before->v_odom.x() : 0.0;
    const FeatureSet features =
        Street().scan(kPeriod_s * k, kPeriod_s * k * kSpeed, kSpeed, v_deskew, static_cast<unsigned>(k + 1));
    const auto result = estimator.add(features, degeneracy::Degeneracy(), std::nullopt);
    ASSERT_TRUE(result);
    if (k > 0) {
      EXPECT_NEAR(result->state.v_odom.x(), kSpeed, k < 30 ? 0.6 : 0.2) << k;
    }
  }
}

/// Readings of the interval before `time_s` that are always the same.
imu::Preintegration steady_imu(double time_s, const Eigen::Vector3d& felt) {
  std::vector<imu::ImuSample> samples;
  for (int n = -20; n <= 0; ++n) {
    samples.push_back({to_nanoseconds(time_s + 0.05 * kPeriod_s * n), felt, Eigen::Vector3d::Zero()});
  }
  imu::Preintegration imu =
      imu::preintegrate(samples, samples.front().stamp, samples.back().stamp, Eigen::Vector3d::Zero(),
                        Eigen::Vector3d::Zero(), imu::ImuNoise(), ImuConfig());
  imu.recent.count = 200;
  imu.recent.duration_s = 1.0;
  imu.recent.mean_acceleration = felt;
  imu.recent.acceleration_std = 1.0;
  return imu;
}

/// A drive along the street that begins at 3 m/s, scan by scan, with an accelerometer that always feels the
/// same.
class Drive {
 public:
  Drive(double gained_mps2, const Eigen::Vector3d& felt) : gained_mps2_(gained_mps2), felt_(felt) {}

  double speed_at(double time_s) const { return 3.0 + gained_mps2_ * time_s; }

  std::optional<EstimateResult> add_scan(int k, Estimator* estimator) const {
    const double time_s = kPeriod_s * k;
    const double here_m = (3.0 + 0.5 * gained_mps2_ * time_s) * time_s;
    const imu::Preintegration imu = steady_imu(time_s, felt_);
    const std::optional<imu::NavState> before = estimator->state();
    const double v_deskew = before ? before->v_odom.norm() : 0.0;
    const FeatureSet features =
        Street().scan(time_s, here_m, speed_at(time_s), v_deskew, static_cast<unsigned>(k + 1));
    return estimator->add(features, degeneracy::Degeneracy(), imu);
  }

 private:
  double gained_mps2_;
  Eigen::Vector3d felt_;
};

/// What is felt of gathering speed looks like a slope until scans and IMU are aligned.
TEST(Estimator, AnAlignmentInMotionEstimatesAllScansAnew) {
  constexpr double kGained = 1.0;
  const Config config;
  const Drive drive(kGained, Eigen::Vector3d(kGained, 0.0, config.sensor.gravity_mps2));
  Reporter reporter;
  Estimator estimator(config, &reporter);
  for (int k = 0; k <= config.imu.moving_init_scans; ++k) {
    const auto result = drive.add_scan(k, &estimator);
    ASSERT_TRUE(result);
    EXPECT_FALSE(result->is_keyframe);
    ASSERT_EQ(result->revised.size(), k < config.imu.moving_init_scans ? 0U : static_cast<std::size_t>(k));
    for (std::size_t n = 0; n < result->revised.size(); ++n) {
      const imu::NavState& state = result->revised[n];
      EXPECT_EQ(state.imu_status, imu::ImuStatus::kInitialised);
      EXPECT_NEAR(state.v_odom.norm(), drive.speed_at(kPeriod_s * static_cast<double>(n)), 0.1) << n;
      const Eigen::Vector3d g_imu = state.q_odom_imu.conjugate() * state.g_odom;
      EXPECT_LT((g_imu - Eigen::Vector3d(0.0, 0.0, -config.sensor.gravity_mps2)).norm(), 0.3) << n;
    }
  }
}

/// The lidar's first scans may lie before the first reading: its data come later, or its driver started
/// earlier.
TEST(Estimator, ScansBeforeTheFirstReadingStandUprightInTheEnd) {
  const Config config;
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 2.0, 0.0).normalized()));
  const Eigen::Vector3d felt = tilt * Eigen::Vector3d(0.0, 0.0, config.sensor.gravity_mps2);
  imu::Preintegration none = steady_imu(0.0, felt);
  none.sample_count = 0;
  none.recent = imu::ImuStatistics();
  for (const std::optional<imu::Preintegration>& before :
       {std::optional<imu::Preintegration>(), std::optional(none)}) {
    Reporter reporter;
    Estimator estimator(config, &reporter);
    const Street street;
    std::optional<EstimateResult> result;
    for (int k = 0; k < 3; ++k) {
      const FeatureSet features = street.scan(kPeriod_s * k, 0.0, 0.0, 0.0, static_cast<unsigned>(k + 1));
      result =
          estimator.add(features, degeneracy::Degeneracy(), k < 2 ? before : steady_imu(kPeriod_s * k, felt));
      ASSERT_TRUE(result);
      EXPECT_EQ(result->revised.size(), k < 2 ? 0U : 2U);
      EXPECT_EQ(reporter.has("late_imu"), k == 2);
    }
    for (const imu::NavState& state : {result->revised[0], result->revised[1], result->state}) {
      EXPECT_LT((state.q_odom_imu * felt.normalized() - Eigen::Vector3d::UnitZ()).norm(), 0.01);
    }
  }
}

/// What an IMU feels on a smooth drive is what it feels at rest. The scans tell which of them it is.
TEST(Estimator, AnImuThatSeemsToStandIsBelievedOnlyIfTheScansSayTheSame) {
  const Config config;
  const Eigen::Vector3d felt(0.0, 0.0, config.sensor.gravity_mps2);
  for (const double speed_mps : {0.0, 1.0, 8.0}) {
    Reporter reporter;
    Estimator estimator(config, &reporter);
    for (int k = 0; k <= config.imu.moving_init_scans; ++k) {
      const double time_s = kPeriod_s * k;
      imu::Preintegration imu = steady_imu(time_s, felt);
      imu.recent.acceleration_std = 0.01;
      const std::optional<imu::NavState> before = estimator.state();
      const double v_deskew = before ? before->v_odom.x() : 0.0;
      const FeatureSet features =
          Street().scan(time_s, speed_mps * time_s, speed_mps, v_deskew, static_cast<unsigned>(k + 1));
      const auto result = estimator.add(features, degeneracy::Degeneracy(), imu);
      ASSERT_TRUE(result);
      if (k == 1) {
        EXPECT_EQ(result->state.imu_status == imu::ImuStatus::kInitialised, speed_mps == 0.0) << speed_mps;
      }
    }
    const imu::NavState end = *estimator.state();
    EXPECT_NEAR(end.v_odom.x(), speed_mps, 0.1);
    EXPECT_NEAR(end.t_odom_imu.x(), speed_mps * kPeriod_s * config.imu.moving_init_scans, 0.1);
  }
}

/// Of a sensor that stands, deskewed as if it moved along x with `v_deskew_mps`.
FeatureSet standing_scan(int k, double v_deskew_mps = 0.0) {
  return Street().scan(kPeriod_s * k, 0.0, 0.0, v_deskew_mps, static_cast<unsigned>(k + 1));
}

/// What its IMU feels, and besides that `ahead_mps2`.
imu::Preintegration standing_imu(int k, double ahead_mps2 = 0.0) {
  imu::Preintegration imu =
      steady_imu(kPeriod_s * k, Eigen::Vector3d(ahead_mps2, 0.0, SensorConfig().gravity_mps2));
  imu.recent.acceleration_std = 0.01;
  return imu;
}

/// As a sensor sees the features that has turned by `turned_at(time of the point)` [rad] about the vertical.
void turn(const std::function<double(double)>& turned_at, FeatureSet* features) {
  for (Point& point : features->planes) {
    const Eigen::Quaterniond q = so3::exp_q(-turned_at(point.time_s) * Eigen::Vector3d::UnitZ());
    point.position = (q * point.position.cast<double>()).cast<float>();
  }
}

/// A gyro that feels nothing of a turn, of which all happens in one scan of a sensor that stands: that scan
/// is sheared. Nobody learns from it, and it is no keyframe; the next that is not sheared is.
TEST(Estimator, AScanThatTheGyroDeskewedWronglyIsNotLearnedFrom) {
  constexpr int kTurned = 20;
  constexpr double kTurn = 40.0 * M_PI / 180.0;
  Config config;
  config.mapping.keyframe_distance_m = 1.0;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  std::size_t voxels = 0;
  bool is_turned_keyframe = false;
  for (int k = 0; k < kTurned + 8; ++k) {
    FeatureSet features = standing_scan(k);
    // The turn takes the middle fifth of the scan.
    turn(
        [k](double time_s) {
          const double share = std::clamp(5.0 * (time_s / kPeriod_s + 0.6), 0.0, 1.0);
          return k < kTurned ? 0.0 : (k == kTurned ? share * kTurn : kTurn);
        },
        &features);
    const auto result = estimator.add(features, degeneracy::Degeneracy(), standing_imu(k));
    ASSERT_TRUE(result);
    if (k == kTurned - 1) voxels = estimator.map_voxel_count();
    if (k == kTurned) {
      EXPECT_TRUE(reporter.has("gyro_missed"));
      EXPECT_FALSE(result->is_keyframe);
      EXPECT_EQ(estimator.map_voxel_count(), voxels);
    }
    if (k > kTurned) is_turned_keyframe = is_turned_keyframe || result->is_keyframe;
  }
  EXPECT_TRUE(is_turned_keyframe);
  const imu::NavState end = *estimator.state();
  EXPECT_LT(end.q_odom_imu.angularDistance(so3::exp_q(kTurn * Eigen::Vector3d::UnitZ())), 0.005);
  EXPECT_LT(end.t_odom_imu.norm(), 0.05);
  EXPECT_LT(end.v_odom.norm(), 0.05);
  EXPECT_LT(end.gyro_bias.norm(), 0.01);
}

/// A gyro that feels nothing of two degrees about the vertical in half a second, of which the ground, most of
/// each scan, feels nothing either.
TEST(Estimator, ASlowTurnThatTheGyroMissesIsFound) {
  constexpr int kTurned = 40;
  constexpr int kTurning = 5;
  constexpr double kTurn = 2.0 * M_PI / 180.0;
  Config config;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  for (int k = 0; k < kTurned + 20; ++k) {
    FeatureSet features = standing_scan(k);
    turn(
        [k](double time_s) {
          const double scans = k - kTurned + 1 + time_s / kPeriod_s;
          return std::clamp(scans / kTurning, 0.0, 1.0) * kTurn;
        },
        &features);
    ASSERT_TRUE(estimator.add(features, degeneracy::Degeneracy(), standing_imu(k)));
    EXPECT_FALSE(k < kTurned && reporter.has("gyro_missed")) << k;
  }
  EXPECT_TRUE(reporter.has("gyro_missed"));
  const imu::NavState end = *estimator.state();
  EXPECT_LT(end.q_odom_imu.angularDistance(so3::exp_q(kTurn * Eigen::Vector3d::UnitZ())), 0.003);
  EXPECT_LT(end.t_odom_imu.norm(), 0.03);
  EXPECT_LT(end.gyro_bias.norm(), 0.003);
}

/// Leaves in the air, elsewhere in each scan: nothing matches them.
void add_leaves(int count, unsigned seed, FeatureSet* features) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int k = 0; k < count; ++k) {
    const double x = -15.0 + 20.0 * uniform(random);
    const double y = 8.0 * uniform(random);
    Point point;
    point.position = Eigen::Vector3d(x, y, 4.0 + 8.0 * uniform(random)).cast<float>();
    features->planes.push_back(point);
  }
}

/// A sensor stands whose accelerometer feels something ahead for half a second, as if a car set off. Few
/// fronts tell the way along, and what a scan moves the estimate by hardly tells that it is wrong. Meanwhile
/// the air fills with leaves.
void expect_that_it_stands(double felt_mps2, int leaves) {
  SCOPED_TRACE(felt_mps2);
  constexpr int kStruck = 40;
  constexpr int kScans = 5;
  Config config;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  for (int k = 0; k < kStruck + 20; ++k) {
    const double ahead_mps2 = k >= kStruck && k < kStruck + kScans ? felt_mps2 : 0.0;
    const double v_before = k > 0 ? estimator.state()->v_odom.x() : 0.0;
    FeatureSet features = standing_scan(k, v_before + 0.5 * kPeriod_s * ahead_mps2);
    add_leaves(leaves * std::clamp(k - kStruck + 3, 0, kScans) / kScans, static_cast<unsigned>(k), &features);
    ASSERT_TRUE(estimator.add(features, degeneracy::Degeneracy(), standing_imu(k, ahead_mps2)));
    EXPECT_FALSE(k < kStruck && reporter.has("accel_missed")) << k;
  }
  EXPECT_TRUE(reporter.has("accel_missed"));
  EXPECT_FALSE(reporter.has("gyro_missed"));
  const imu::NavState end = *estimator.state();
  EXPECT_LT(end.t_odom_imu.norm(), 0.1);
  EXPECT_LT(end.v_odom.norm(), 0.2);
  EXPECT_LT(end.accel_bias.norm(), 0.1);
}

TEST(Estimator, AnAccelerationThatTheScansContradictIsNotBelieved) {
  for (const double felt_mps2 : {0.5, 1.0, 3.0}) expect_that_it_stands(felt_mps2, 0);
}

TEST(Estimator, AFalseAccelerationIsFoundWhereTheShareOfMatchesFalls) { expect_that_it_stands(1.0, 500); }

/// An open road with rails on both sides, of which nothing tells the way along but the rears of vehicles that
/// stand when the sensor does, and drive along as it sets off.
FeatureSet scan_in_traffic(int k, double speed_mps, double v_deskew_mps) {
  std::mt19937 random(static_cast<unsigned>(k + 1));
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.02);
  FeatureSet features;
  features.stamp = static_cast<Stamp>(std::llround(1e9 * kPeriod_s * k));
  const auto add = [&](const Eigen::Vector3d& from_end, double v_place_mps) {
    Point point;
    point.time_s = static_cast<float>(-kPeriod_s * uniform(random));
    Eigen::Vector3d seen = from_end + Eigen::Vector3d(noise(random), noise(random), noise(random));
    seen.x() += (v_deskew_mps - speed_mps + v_place_mps) * point.time_s;
    point.position = seen.cast<float>();
    features.planes.push_back(point);
  };
  for (int i = 0; i < 4000; ++i) {
    add({-20.0 + 40.0 * uniform(random), -10.0 + 20.0 * uniform(random), -1.7}, 0.0);
    const double side = i % 2 == 0 ? 10.0 : -10.0;
    add({-20.0 + 40.0 * uniform(random), side, -1.7 + uniform(random)}, 0.0);
  }
  for (const double rear : {8.0, 13.0, 19.0}) {
    for (int i = 0; i < 18; ++i)
      add({rear, -4.0 + 2.0 * uniform(random), -1.5 + 1.5 * uniform(random)}, speed_mps);
  }
  return features;
}

/// The IMU says that the sensor sets off; what sets off with it says that it stands.
TEST(Estimator, WhatTravelsAlongIsNoBlow) {
  constexpr int kStanding = 40;
  constexpr double kAcceleration = 2.0;
  Config config;
  Reporter reporter;
  Estimator estimator(config, &reporter);
  double speed_mps = 0.0;
  double here_m = 0.0;
  for (int k = 0; k < kStanding + 20; ++k) {
    const double ahead_mps2 = k >= kStanding ? kAcceleration : 0.0;
    here_m += kPeriod_s * (speed_mps + 0.5 * kPeriod_s * ahead_mps2);
    speed_mps += kPeriod_s * ahead_mps2;
    const double v_before = k > 0 ? estimator.state()->v_odom.x() : 0.0;
    const FeatureSet features = scan_in_traffic(k, speed_mps, v_before + 0.5 * kPeriod_s * ahead_mps2);
    ASSERT_TRUE(estimator.add(features, degeneracy::Degeneracy(), standing_imu(k, ahead_mps2)));
  }
  EXPECT_FALSE(reporter.has("accel_missed"));
  EXPECT_NEAR(estimator.state()->v_odom.x(), speed_mps, 0.3);
  EXPECT_NEAR(estimator.state()->t_odom_imu.x(), here_m, 0.3);
}

/// Gravity that lies across the ground by 8 degrees is not believed of what came before.
TEST(Estimator, AnAlignmentThatTheGroundContradictsEstimatesNothingAnew) {
  const Config config;
  const double tilt = 8.0 * M_PI / 180.0;
  const Drive drive(0.0, config.sensor.gravity_mps2 * Eigen::Vector3d(0.0, std::sin(tilt), std::cos(tilt)));
  Reporter reporter;
  Estimator estimator(config, &reporter);
  const int last = static_cast<int>(ImuStart::most_intervals(config.imu));
  for (int k = 0; k <= last; ++k) {
    const auto result = drive.add_scan(k, &estimator);
    ASSERT_TRUE(result);
    EXPECT_TRUE(result->revised.empty()) << k;
    EXPECT_EQ(result->state.imu_status,
              k < last ? imu::ImuStatus::kInitialising : imu::ImuStatus::kInitialised)
        << k;
  }
}

struct Along {
  double error;
  double variance;  ///< stated
};

struct Outcome {
  Along velocity;
  Along position;
};

/// After ten seconds on a bare road with a velocity that was wrong by 1 m/s at the start.
Outcome drive_on_a_bare_road(bool watch_velocity) {
  constexpr double kSpeed = 20.0;
  Config config;
  config.mapping.watch_velocity = watch_velocity;
  config.mapping.covariance_factor = 0.01;  // leaves of the position's what the watch knows
  Reporter reporter;
  ScanEstimator estimator(config, &reporter, StageTimer());
  MovingStart start;
  start.v_odom.x() = kSpeed - 1.0;
  start.sigma.velocity = 0.3;
  start.sigma.gravity = 0.15;
  estimator.begin_moving(start);
  SyntheticRoad road;
  road.with_traffic = false;
  Outcome outcome{};
  for (int k = 0; k < 100; ++k) {
    EstimatorInput input;
    if (const auto before = estimator.state()) input.v_deskew = before->v_odom;
    input.features = road.scan(kPeriod_s * k, kSpeed, 0.0, static_cast<unsigned>(k));
    for (Point& point : input.features.planes)
      point.position += (static_cast<double>(point.time_s) * input.v_deskew).cast<float>();
    input.imu = steady_imu(kPeriod_s * k, Eigen::Vector3d(0.0, 0.0, config.sensor.gravity_mps2));
    const auto result = estimator.add(std::move(input), false);
    EXPECT_TRUE(result);
    if (!result) continue;
    outcome.velocity = {std::abs(result->state.v_odom.x() - kSpeed), result->velocity_covariance(0, 0)};
    outcome.position = {std::abs(result->state.t_odom_imu.x() - kSpeed * kPeriod_s * k),
                        result->covariance(3, 3)};
  }
  EXPECT_EQ(reporter.has("brightness_velocity"), watch_velocity);
  return outcome;
}

/// A flat road looks the same to surfaces, however fast one drives on it.
TEST(ScanEstimator, OnABareRoadTheBrightnessTellsTheVelocity) {
  const Outcome watched = drive_on_a_bare_road(true);
  const Outcome unwatched = drive_on_a_bare_road(false);
  EXPECT_LT(watched.velocity.error, 0.3);
  EXPECT_GT(unwatched.velocity.error, 0.8);
  EXPECT_GT(watched.velocity.variance - unwatched.velocity.variance, 0.005);
  EXPECT_GT(watched.position.variance, unwatched.position.variance + 5.0);
  EXPECT_LT(watched.position.variance, 100.0);
  EXPECT_LT(watched.position.error * watched.position.error, 9.0 * watched.position.variance);
}

}  // namespace
}  // namespace fdi_lio::odometry
