#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/smoother.hpp"

namespace fdi_lio::odometry {
namespace {

/// The lidar says exactly where the truth is, with 1 cm and 1 mrad.
matching::LidarInformation lidar_at(const imu::NavState& truth) {
  matching::LidarInformation information;
  information.q_odom_imu = truth.q_odom_imu;
  information.t_odom_imu = truth.t_odom_imu;
  information.H.diagonal() << 1e6, 1e6, 1e6, 1e4, 1e4, 1e4;
  return information;
}

class Window : public testing::Test {
 protected:
  imu::Preintegration interval(int k, const imu::NavState& from) const {
    // What is read at the stamps of the scans, with the offset known so far.
    const double early_s = time_offset_s_ - from.lidar_time_offset_s;
    auto samples = motion_.samples(0.1 * k - early_s, 0.1 * (k + 1) - early_s, 200.0);
    for (imu::ImuSample& sample : samples) {
      sample.angular_velocity = gyro_reads_ * sample.angular_velocity + gyro_bias_;
      sample.acceleration += accel_bias_;
    }
    imu::Preintegration p =
        imu::preintegrate(samples, samples.front().stamp, samples.back().stamp, from.errors(),
                          imu::ImuNoise{1e-4, 1e-3, 1e-5, 1e-4}, ImuConfig());
    p.from = motion_.state(0.1 * k).stamp;
    p.to = motion_.state(0.1 * (k + 1)).stamp;
    return p;
  }

  /// Runs `count` scans and returns the newest state.
  imu::NavState run(int window, int count, const Smoother::CalibrationSigma& calibration = {},
                    double tilt_walk = 0.0) {
    Smoother smoother(window, 9.81, calibration, tilt_walk);
    imu::NavState first = motion_.state(0.0);
    first.mounting.setZero();
    smoother.start(first, Smoother::InitialSigma());
    for (int k = 0; k < count; ++k) {
      const imu::Preintegration p = interval(k, smoother.newest());
      smoother.add(imu::predict(smoother.newest(), p), p, true, Eigen::Vector3d::Zero());
      smoother.set_lidar(lidar_at(in_tilting_map(k + 1)));
      EXPECT_TRUE(smoother.solve());
    }
    covariance_ = smoother.covariance();
    return smoother.newest();
  }

  /// The truth after k scans in the axes of a map that has turned by `tilt_per_scan_` k about x.
  imu::NavState in_tilting_map(int k) const {
    imu::NavState state = motion_.state(0.1 * k);
    Eigen::Vector3d place = motion_.state(0.0).t_odom_imu;
    for (int i = 1; i <= k; ++i)
      place += tilt(i) * (motion_.state(0.1 * i).t_odom_imu - motion_.state(0.1 * (i - 1)).t_odom_imu);
    state.q_odom_imu = tilt(k) * state.q_odom_imu;
    state.t_odom_imu = place;
    state.g_odom = tilt(k) * state.g_odom;
    return state;
  }
  Eigen::Quaterniond tilt(int k) const {
    return Eigen::Quaterniond(Eigen::AngleAxisd(tilt_per_scan_ * k, Eigen::Vector3d::UnitX()));
  }

  double tilt_per_scan_ = 0.0;  ///< [rad]
  double time_offset_s_ = 0.0;  ///< of the clock of the IMU against that of the scans
  imu::SyntheticMotion motion_;
  Eigen::Matrix3d gyro_reads_ = Eigen::Matrix3d::Identity();  ///< of a true rate
  Eigen::Vector3d gyro_bias_ = Eigen::Vector3d(0.01, -0.005, 0.008);
  Eigen::Vector3d accel_bias_ = Eigen::Vector3d(0.05, -0.03, 0.04);
  Matrix15d covariance_;
};

TEST_F(Window, FindsBiasesVelocityAndPose) {
  const imu::NavState found = run(4, 100);
  const imu::NavState truth = motion_.state(10.0);
  EXPECT_LT((found.t_odom_imu - truth.t_odom_imu).norm(), 2e-3);
  EXPECT_LT((found.v_odom - truth.v_odom).norm(), 0.01);
  EXPECT_LT((found.gyro_bias - gyro_bias_).norm(), 5e-4);
  EXPECT_LT((found.accel_bias - accel_bias_).norm(), 0.02);
}

TEST_F(Window, FindsTheMounting) {
  motion_.mounting = Eigen::Vector3d(0.02, -0.015, 0.03);
  const imu::NavState found = run(4, 300, {0.02, 0.0});
  EXPECT_LT((found.mounting - motion_.mounting).norm(), 1e-3) << found.mounting.transpose();
  EXPECT_LT((found.accel_bias - accel_bias_).norm(), 0.02);
  EXPECT_LT((found.gyro_bias - gyro_bias_).norm(), 5e-4);
  // Taken as stated, it goes into the biases instead.
  const imu::NavState stated = run(4, 300);
  EXPECT_LT(stated.mounting.norm(), 1e-5);
  EXPECT_GT((stated.gyro_bias - gyro_bias_).norm(), 5e-3);
}

TEST_F(Window, FindsTheTimeOffset) {
  for (const double offset_s : {-0.03, 0.002, 0.08}) {
    time_offset_s_ = offset_s;
    const imu::NavState found = run(4, 300, {0.0, 0.05});
    EXPECT_NEAR(found.lidar_time_offset_s, offset_s, 1e-3);
    EXPECT_LT((found.gyro_bias - gyro_bias_).norm(), 5e-4);
    EXPECT_LT((found.accel_bias - accel_bias_).norm(), 0.02);
  }
  // Taken as stated, it stays as it is.
  EXPECT_LT(std::abs(run(4, 100).lidar_time_offset_s), 1e-5);
}

// The rate about z hardly changes in this motion, so that its scales and the bias are known together only.
TEST_F(Window, FindsTheScalesOfTheGyro) {
  Eigen::Matrix3d scale = Eigen::Vector3d(0.02, -0.015, 0.01).asDiagonal();
  scale(0, 2) = 0.004;
  scale(2, 0) = -0.003;
  gyro_reads_ = (Eigen::Matrix3d::Identity() - scale).inverse();
  const auto worst_rate = [this](const imu::NavState& state) {
    double worst = 0.0;
    for (double t = 0.0; t < 30.0; t += 0.1) {
      const Eigen::Vector3d rate = motion_.rate(t);
      const Eigen::Vector3d found = state.errors().angular_velocity(gyro_reads_ * rate + gyro_bias_);
      worst = std::max(worst, (found - rate).norm());
    }
    return worst;
  };
  const imu::NavState found = run(4, 300, {0.0, 0.0, 0.02, 0.005});
  EXPECT_LT((found.gyro_scale - scale).leftCols<2>().cwiseAbs().maxCoeff(), 3e-4) << found.gyro_scale;
  EXPECT_LT(worst_rate(found), 3e-4);
  // Taken as stated, what the bias cannot stand for is left.
  const imu::NavState stated = run(4, 300);
  EXPECT_LT(stated.gyro_scale.norm(), 1e-5);
  EXPECT_GT(worst_rate(stated), 3e-3);
}

TEST_F(Window, GravityFollowsAMapThatTilts) {
  tilt_per_scan_ = 5e-4;
  const Eigen::Vector3d g = in_tilting_map(200).g_odom;
  const imu::NavState found = run(4, 200, {}, 3e-3);
  EXPECT_LT((found.g_odom - g).norm(), 0.2) << found.g_odom.transpose();
  EXPECT_LT((found.accel_bias - accel_bias_).norm(), 0.05) << found.accel_bias.transpose();
  // A direction that may not change is the mean of the way.
  const imu::NavState fixed = run(4, 200);
  EXPECT_GT((fixed.g_odom - g).norm(), 2.0 * (found.g_odom - g).norm());
}

// All beams point too high: the map bends as map_bend() says. The smoother finds by how much, gravity stays
// right, and what is said to be taken out of the scans is not found again.
TEST_F(Window, FindsTheElevationThatBendsTheMap) {
  constexpr double kElevation = 4e-3;
  constexpr double kRadius = 5.0;
  constexpr int kTakenOutAt = 200;
  Smoother smoother(4, 9.81, {}, 1e-4);
  Smoother::InitialSigma sigma;
  sigma.beam_elevation = 5e-3;
  imu::NavState mapped = motion_.state(0.0);
  smoother.start(mapped, sigma);
  Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
  imu::NavState found;
  for (int k = 0; k < 2 * kTakenOutAt; ++k) {
    const imu::NavState before = motion_.state(0.1 * k);
    const imu::NavState now = motion_.state(0.1 * (k + 1));
    const Eigen::Vector3d step = now.t_odom_imu - before.t_odom_imu;
    const Eigen::Vector3d bend =
        map_bend(Eigen::Vector3d::UnitZ(), before.q_odom_imu.conjugate() * step, kRadius);
    const double elevation = k < kTakenOutAt ? kElevation : 0.0;
    mapped.t_odom_imu += turned * step;
    turned = turned * so3::exp_q(Eigen::Vector3d(before.q_odom_imu * bend * elevation));
    mapped.q_odom_imu = turned * now.q_odom_imu;
    mapped.g_odom = turned * now.g_odom;
    const imu::Preintegration p = interval(k, smoother.newest());
    smoother.add(imu::predict(smoother.newest(), p), p, true, bend);
    smoother.set_lidar(lidar_at(mapped));
    ASSERT_TRUE(smoother.solve());
    if (k + 1 == kTakenOutAt) {
      found = smoother.newest();
      EXPECT_NEAR(found.beam_elevation, kElevation, 0.1 * kElevation);
      EXPECT_LT((found.g_odom - mapped.g_odom).norm(), 0.05);
      EXPECT_LT((found.accel_bias - accel_bias_).norm(), 0.05) << found.accel_bias.transpose();
      smoother.reduce_beam_elevation(found.beam_elevation);
    }
  }
  EXPECT_NEAR(smoother.newest().beam_elevation, 0.0, 0.1 * kElevation);
  EXPECT_LT((smoother.newest().g_odom - mapped.g_odom).norm(), 0.05);
}

TEST_F(Window, MarginalisationLosesNothingOnALinearProblem) {
  // A window that holds everything and one that marginalises almost everything see the same information.
  const imu::NavState all = run(20, 19);
  const Matrix15d covariance_all = covariance_;
  const imu::NavState short_window = run(2, 19);
  EXPECT_LT((all.t_odom_imu - short_window.t_odom_imu).norm(), 1e-4);
  EXPECT_LT((all.v_odom - short_window.v_odom).norm(), 1e-3);
  for (int k = 0; k < 15; ++k) {
    EXPECT_NEAR(std::sqrt(covariance_(k, k) / covariance_all(k, k)), 1.0, 0.05) << "component " << k;
  }
}

TEST_F(Window, AShiftMovesTheEstimateAndKeepsWhatIsKnown) {
  const Eigen::Vector3d velocity(0.4, -0.1, 0.0);
  const Eigen::Vector3d gravity(0.2, 0.0, 0.0);
  Smoother smoother(3, 9.81, {}, 0.0);
  smoother.start(motion_.state(0.0), Smoother::InitialSigma());
  const imu::Preintegration p = interval(0, smoother.newest());
  smoother.add(imu::predict(smoother.newest(), p), p, true, Eigen::Vector3d::Zero());
  ASSERT_TRUE(smoother.solve());
  const imu::NavState before = smoother.newest();
  const Matrix15d covariance = smoother.covariance();
  smoother.shift(velocity, gravity);
  const imu::NavState after = smoother.newest();
  EXPECT_LT((after.v_odom - before.v_odom - velocity).norm(), 1e-12);
  EXPECT_LT((after.g_odom - before.g_odom - gravity).norm(), 0.003);
  EXPECT_NEAR(after.g_odom.norm(), 9.81, 1e-12);
  EXPECT_LT((smoother.covariance() - covariance).norm(), 1e-3 * covariance.norm());
  // Nothing pulls it back: what is known of the past has moved as well.
  ASSERT_TRUE(smoother.solve());
  EXPECT_LT((smoother.newest().v_odom - after.v_odom).norm(), 0.02);
}

// A turn that the gyro missed goes into its bias, unless the motion is replaced by one that knows of it.
TEST_F(Window, AReplacedMotionKeepsAMissedTurnOutOfTheBias) {
  const Eigen::Vector3d turn(0.1, -0.2, 0.15);
  for (const bool is_replaced : {false, true}) {
    Smoother smoother(4, 9.81, {}, 0.0);
    smoother.start(motion_.state(0.0), Smoother::InitialSigma());
    for (int k = 0; k < 30; ++k) {
      const imu::NavState before = smoother.newest();
      imu::Preintegration p = interval(k, before);
      const bool is_struck = k == 20;
      if (is_struck) p.delta_q = p.delta_q * so3::exp_q(-turn);
      smoother.add(imu::predict(before, p), p, true, Eigen::Vector3d::Zero());
      if (is_struck && is_replaced) {
        const imu::Preintegration motion = imu::with_missed_turn(p, turn);
        smoother.replace_newest(imu::predict(before, motion), motion, {turn.norm(), 0.0});
      }
      smoother.set_lidar(lidar_at(motion_.state(0.1 * (k + 1))));
      ASSERT_TRUE(smoother.solve());
      const double error = (smoother.newest().gyro_bias - gyro_bias_).norm();
      if (is_struck) {
        EXPECT_EQ(error < 2e-3, is_replaced) << error;
      }
    }
    const imu::NavState truth = motion_.state(3.0);
    if (is_replaced) {
      EXPECT_LT((smoother.newest().v_odom - truth.v_odom).norm(), 0.02);
    }
  }
}

TEST_F(Window, WithoutLidarTheCovarianceGrows) {
  run(4, 10);
  const Matrix15d with_lidar = covariance_;
  Smoother smoother(4, 9.81, {}, 0.0);
  smoother.start(motion_.state(0.0), Smoother::InitialSigma());
  for (int k = 0; k < 10; ++k) {
    const imu::Preintegration p = interval(k, smoother.newest());
    smoother.add(imu::predict(smoother.newest(), p), p, true, Eigen::Vector3d::Zero());
    ASSERT_TRUE(smoother.solve());
  }
  EXPECT_GT(smoother.covariance()(3, 3), 100.0 * with_lidar(3, 3));
}

}  // namespace
}  // namespace fdi_lio::odometry
