#include <cmath>
#include <cstddef>
#include <optional>

#include "synthetic_road.hpp"
#include "synthetic_street.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/estimator.hpp"
#include "fdi_lio/odometry/imu_start.hpp"
#include "fdi_lio/odometry/scan_estimator.hpp"

namespace fdi_lio::odometry {
namespace {

/// Without an IMU the velocity of one scan deskews the next. The first two were not deskewed.
TEST(ScanEstimator, TheVelocityIsTheTrueOneFromTheSecondScanOn) {
  constexpr double kSpeed = 3.0;
  Reporter reporter;
  Estimator estimator(Config(), &reporter);
  for (int k = 0; k < 40; ++k) {
    const std::optional<imu::NavState> before = estimator.state();
    const double v_deskew = before ? before->v_odom.x() : 0.0;
    const FeatureSet features = SyntheticStreet().scan(kPeriod_s * k, kPeriod_s * k * kSpeed, kSpeed,
                                                       v_deskew, static_cast<unsigned>(k + 1));
    const auto result = estimator.add(features, degeneracy::Degeneracy(), std::nullopt);
    ASSERT_TRUE(result);
    if (k > 0) {
      EXPECT_NEAR(result->state.v_odom.x(), kSpeed, k < 30 ? 0.6 : 0.2) << k;
    }
  }
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
        SyntheticStreet().scan(time_s, here_m, speed_at(time_s), v_deskew, static_cast<unsigned>(k + 1));
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
    const SyntheticStreet street;
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
      const FeatureSet features = SyntheticStreet().scan(time_s, speed_mps * time_s, speed_mps, v_deskew,
                                                         static_cast<unsigned>(k + 1));
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
