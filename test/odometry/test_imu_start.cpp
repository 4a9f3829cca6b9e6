#include <optional>
#include <random>
#include <vector>

#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/imu_start.hpp"

namespace fdi_lio::odometry {
namespace {

const std::optional<Eigen::Vector3d> kLevel = Eigen::Vector3d::UnitZ();  ///< ground

/// What a sensor at rest reports that is rolled by 0.1 rad, with a turning rate that is its bias.
imu::Preintegration rest() {
  imu::Preintegration result;
  result.recent.count = 100;
  result.recent.duration_s = ImuConfig().static_duration_s;
  result.recent.mean_angular_velocity = Eigen::Vector3d(1e-3, -2e-3, 3e-3);
  result.recent.mean_acceleration = 9.83 * Eigen::Vector3d(0.0, std::sin(0.1), std::cos(0.1));
  return result;
}

TEST(ImuStart, AtRestGravityAndBiasAreTheMeans) {
  Config config;
  config.sensor.gravity_mps2 = 9.80665;
  config.sensor.accel_bias_sigma_mps2 = 0.42;
  Reporter reporter;
  const ImuStart start(config, &reporter);
  imu::NavState state;
  state.q_odom_imu = imu::level_orientation(rest().recent);
  state.v_odom = Eigen::Vector3d(0.05, 0.0, 0.0);
  const auto found = start.at_rest(state, rest());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->state.imu_status, imu::ImuStatus::kInitialised);
  EXPECT_EQ(found->state.v_odom.norm(), 0.0);
  EXPECT_LT((found->state.gyro_bias - Eigen::Vector3d(1e-3, -2e-3, 3e-3)).norm(), 1e-12);
  EXPECT_LT((found->state.g_odom - Eigen::Vector3d(0.0, 0.0, -9.80665)).norm(), 1e-9);
  EXPECT_TRUE(reporter.has("imu_static"));
  // A bias across gravity has tilted it by as much.
  EXPECT_EQ(found->sigma.accel_bias, config.sensor.accel_bias_sigma_mps2);
  EXPECT_EQ(found->sigma.gravity, config.sensor.accel_bias_sigma_mps2);
}

/// The length of what is felt tells the bias along gravity. Without it the estimate would rise or sink by the
/// difference, where few beams see the ground.
TEST(ImuStart, AtRestTheStatePredictsRest) {
  constexpr double kBias = 0.4;  // [m/s^2]
  Config config;
  Reporter reporter;
  imu::Preintegration readings = rest();
  readings.recent.mean_acceleration =
      (config.sensor.gravity_mps2 + kBias) * readings.recent.mean_acceleration.normalized();
  imu::NavState state;
  state.q_odom_imu = imu::level_orientation(readings.recent);
  const auto found = ImuStart(config, &reporter).at_rest(state, readings);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->state.accel_bias.norm(), kBias, 1e-9);
  std::vector<imu::ImuSample> samples;
  for (Stamp stamp = 0; stamp <= to_nanoseconds(1.0); stamp += to_nanoseconds(0.01)) {
    samples.push_back({stamp, readings.recent.mean_acceleration, readings.recent.mean_angular_velocity});
  }
  const imu::Preintegration motion = imu::preintegrate(samples, samples.front().stamp, samples.back().stamp,
                                                       {found->state.gyro_bias}, imu::ImuNoise(), config.imu);
  const imu::NavState after = imu::predict(found->state, motion);
  EXPECT_LT(after.v_odom.norm(), 1e-6);
  EXPECT_LT((after.t_odom_imu - found->state.t_odom_imu).norm(), 1e-6);
}

TEST(ImuStart, ASmoothDriveIsNotAtRest) {
  Reporter reporter;
  const ImuStart start(Config(), &reporter);
  imu::NavState state;
  state.v_odom = Eigen::Vector3d(15.0, 0.0, 0.0);
  EXPECT_FALSE(start.at_rest(state, rest()));
}

/// States at the scans of a known motion, and the IMU between them.
class Drive {
 public:
  explicit Drive(double gravity_mps2) { motion_.gravity = Eigen::Vector3d(0.0, 0.0, -gravity_mps2); }

  imu::NavState state(int k) const {
    imu::NavState result;
    result.q_odom_imu = motion_.attitude(0.1 * k);
    result.t_odom_imu = motion_.position(0.1 * k);
    return result;
  }

  imu::Preintegration imu(int k) const {
    const auto samples = motion_.samples(0.1 * (k - 1), 0.1 * k, 200.0);
    return imu::preintegrate(samples, samples.front().stamp, samples.back().stamp, {}, imu::ImuNoise(),
                             ImuConfig());
  }

  Eigen::Vector3d velocity(int k) const { return motion_.velocity(0.1 * k); }

 private:
  imu::SyntheticMotion motion_;
};

TEST(ImuStart, InMotionTheVelocityIsFoundAfterTheGivenScans) {
  Config config;
  Reporter reporter;
  ImuStart start(config, &reporter);
  const Drive drive(config.sensor.gravity_mps2);
  for (int k = 1; k < config.imu.moving_init_scans; ++k)
    ASSERT_FALSE(start.in_motion(drive.state(k - 1), drive.state(k), drive.imu(k), kLevel)) << k;
  const int last = config.imu.moving_init_scans;
  const auto found = start.in_motion(drive.state(last - 1), drive.state(last), drive.imu(last), kLevel);
  ASSERT_TRUE(found);
  EXPECT_LT((found->state.v_odom - drive.velocity(last)).norm(), 0.05);
  EXPECT_LT((found->state.g_odom - Eigen::Vector3d(0.0, 0.0, -config.sensor.gravity_mps2)).norm(), 0.1);
  EXPECT_TRUE(reporter.has("imu_moving"));
  EXPECT_EQ(start.interval_count(), static_cast<std::size_t>(last));
  ASSERT_TRUE(found->start);
  EXPECT_LT((found->start->v_odom - drive.velocity(0)).norm(), 0.05);
  EXPECT_LT((found->start->up_odom - Eigen::Vector3d::UnitZ()).norm(), 0.01);
}

TEST(ImuStart, InMotionMoreScansAreWaitedForWhileGravityIsVague) {
  Config config;
  Reporter reporter;
  ImuStart start(config, &reporter);
  const Drive drive(config.sensor.gravity_mps2);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.1);
  const auto scattered = [&](int k) {
    imu::NavState state = drive.state(k);
    state.t_odom_imu += Eigen::Vector3d(noise(random), noise(random), noise(random));
    return state;
  };
  imu::NavState before = scattered(0);
  std::optional<ImuStart::Found> found;
  int scans = 0;
  while (!found && scans < 10 * config.imu.moving_init_scans) {
    ++scans;
    const imu::NavState newest = scattered(scans);
    found = start.in_motion(before, newest, drive.imu(scans), kLevel);
    before = newest;
  }
  ASSERT_TRUE(found);
  EXPECT_GT(scans, config.imu.moving_init_scans);
  EXPECT_LE(static_cast<std::size_t>(scans), ImuStart::most_intervals(config.imu));
  EXPECT_LT((found->state.g_odom - Eigen::Vector3d(0.0, 0.0, -config.sensor.gravity_mps2)).norm(), 0.3);
}

/// Positions that lag behind while the sensor gathers speed tilt what aligns them.
TEST(ImuStart, InMotionTheGroundContradictsATiltedGravity) {
  Config config;
  const Drive drive(config.sensor.gravity_mps2);
  for (const double tilt_deg : {4.0, 6.0}) {
    const Eigen::Vector3d ground =
        Eigen::AngleAxisd(tilt_deg * M_PI / 180.0, Eigen::Vector3d::UnitY()) * Eigen::Vector3d::UnitZ();
    Reporter reporter;
    ImuStart start(config, &reporter);
    std::optional<ImuStart::Found> found;
    std::size_t scans = 0;
    while (!found && scans < 2 * ImuStart::most_intervals(config.imu)) {
      ++scans;
      const int k = static_cast<int>(scans);
      found = start.in_motion(drive.state(k - 1), drive.state(k), drive.imu(k), ground);
    }
    ASSERT_TRUE(found) << tilt_deg;
    const bool is_steep = tilt_deg > 5.0;
    EXPECT_EQ(scans, is_steep ? ImuStart::most_intervals(config.imu)
                              : static_cast<std::size_t>(config.imu.moving_init_scans));
    EXPECT_EQ(found->start.has_value(), !is_steep);
    EXPECT_LT((found->state.v_odom - drive.velocity(static_cast<int>(scans))).norm(), 0.05);
  }
}

TEST(ImuStart, AReviewedStartIsPredictedByTheImuAtOnce) {
  Config config;
  Reporter reporter;
  const ImuStart start(config, &reporter);
  imu::NavState first;
  first.imu_status = imu::ImuStatus::kInitialising;
  first.g_odom = Eigen::Vector3d(0.0, 0.0, -config.sensor.gravity_mps2);
  MovingStart moving;
  moving.v_odom = Eigen::Vector3d(20.0, 1.0, 0.0);
  moving.gyro_bias = Eigen::Vector3d(0.01, 0.0, 0.0);
  moving.accel_bias = Eigen::Vector3d(0.0, 0.1, 0.0);
  moving.sigma.gravity = 0.1;
  const ImuStart::Found cruising = start.moving(first, moving);
  EXPECT_EQ(cruising.state.imu_status, imu::ImuStatus::kInitialised);
  EXPECT_EQ((cruising.state.v_odom - moving.v_odom).norm(), 0.0);
  EXPECT_EQ((cruising.state.g_odom - first.g_odom).norm(), 0.0);
  EXPECT_EQ((cruising.state.gyro_bias - moving.gyro_bias).norm(), 0.0);
  EXPECT_EQ((cruising.state.accel_bias - moving.accel_bias).norm(), 0.0);
  EXPECT_EQ(cruising.sigma.gravity, 0.1);
  moving.up_odom = Eigen::Vector3d(0.6, 0.0, 0.8);
  moving.sigma.gravity = 0.4;
  const ImuStart::Found braking = start.moving(first, moving);
  EXPECT_LT((braking.state.g_odom + config.sensor.gravity_mps2 * moving.up_odom).norm(), 1e-12);
  EXPECT_EQ(braking.sigma.gravity, 0.4);
}

TEST(ImuStart, AReviewedStartWithoutImuKeepsItsVelocity) {
  Reporter reporter;
  MovingStart moving;
  moving.v_odom = Eigen::Vector3d(20.0, 1.0, 0.0);
  const ImuStart::Found found = ImuStart(Config(), &reporter).moving(imu::NavState(), moving);
  EXPECT_EQ(found.state.imu_status, imu::ImuStatus::kNone);
  EXPECT_EQ((found.state.v_odom - moving.v_odom).norm(), 0.0);
}

TEST(ImuStart, AGravityOfTheWrongSizeIsReportedAndTriedAgain) {
  Config config;
  Reporter reporter;
  ImuStart start(config, &reporter);
  const Drive drive(config.sensor.gravity_mps2 + 1.0);
  for (int k = 1; k < 2 * config.imu.moving_init_scans; ++k)
    EXPECT_FALSE(start.in_motion(drive.state(k - 1), drive.state(k), drive.imu(k), kLevel)) << k;
  EXPECT_TRUE(reporter.has("imu_align"));
  EXPECT_FALSE(reporter.has("imu_moving"));
}

}  // namespace
}  // namespace fdi_lio::odometry
