#include <random>

#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/imu/propagation.hpp"

namespace fdi_lio::imu {
namespace {

const ImuNoise kNoise{1e-3, 1e-2, 1e-4, 1e-3};

Preintegration integrate(const std::vector<ImuSample>& samples, const Eigen::Vector3d& bg,
                         const Eigen::Vector3d& ba) {
  return preintegrate(samples, samples.front().stamp, samples.back().stamp, {bg, ba}, kNoise, ImuConfig());
}

TEST(Preintegration, PredictsTheTrueMotion) {
  const SyntheticMotion motion;
  const Preintegration p =
      integrate(motion.samples(0.5, 1.5, 400.0), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  const NavState predicted = predict(motion.state(0.5), p);
  const NavState truth = motion.state(1.5);
  EXPECT_LT((predicted.t_odom_imu - truth.t_odom_imu).norm(), 1e-4);
  EXPECT_LT((predicted.v_odom - truth.v_odom).norm(), 1e-4);
  EXPECT_LT(predicted.q_odom_imu.angularDistance(truth.q_odom_imu), 1e-5);
}

TEST(Preintegration, ClipsToBoundsThatLieBetweenReadings) {
  const SyntheticMotion motion;
  const auto samples = motion.samples(0.0, 1.0, 100.0);
  const Stamp from = to_nanoseconds(100.2537);
  const Stamp to = to_nanoseconds(100.6281);
  const Preintegration p = preintegrate(samples, from, to, {}, kNoise, ImuConfig());
  const NavState predicted = predict(motion.state(0.2537), p);
  EXPECT_LT((predicted.t_odom_imu - motion.position(0.6281)).norm(), 5e-4);
  EXPECT_EQ(p.sample_count, 37U);
}

// A gyro that lacks a steady rate misses an even turn: with it, all is as with a gyro that has it.
TEST(Preintegration, AMissedTurnIsWhatTheGyroLacked) {
  const auto samples = SyntheticMotion().samples(0.0, 0.1, 400.0);
  const Eigen::Vector3d rate(0.5, -1.2, 2.0);
  std::vector<ImuSample> lacking = samples;
  for (ImuSample& sample : lacking) sample.angular_velocity -= rate;
  const Preintegration truth = integrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  const Preintegration wrong = integrate(lacking, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  const Preintegration found = with_missed_turn(wrong, 0.1 * rate);
  EXPECT_GT(wrong.delta_q.angularDistance(truth.delta_q), 0.2);
  EXPECT_LT(found.delta_q.angularDistance(truth.delta_q), 0.02);
  EXPECT_LT((found.delta_v - truth.delta_v).norm(), 0.1 * (wrong.delta_v - truth.delta_v).norm());
  EXPECT_LT((found.delta_p - truth.delta_p).norm(), 0.1 * (wrong.delta_p - truth.delta_p).norm());
  const Matrix15d more = found.covariance - wrong.covariance;
  const double sigma_rad = 0.1 * rate.norm();
  EXPECT_NEAR(more(0, 0), sigma_rad * sigma_rad, 1e-9);
  EXPECT_NEAR(more(6, 6), std::pow(sigma_rad * wrong.delta_v.norm(), 2.0), 1e-9);
}

TEST(Preintegration, BiasJacobiansAreTheNumericDerivatives) {
  const auto samples = SyntheticMotion().samples(0.0, 0.3, 200.0);
  const Preintegration nominal = integrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  constexpr double kStep = 1e-5;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(axis);
    const Preintegration gyro_up = integrate(samples, d, Eigen::Vector3d::Zero());
    const Preintegration gyro_down = integrate(samples, -d, Eigen::Vector3d::Zero());
    const Preintegration accel_up = integrate(samples, Eigen::Vector3d::Zero(), d);
    const Preintegration accel_down = integrate(samples, Eigen::Vector3d::Zero(), -d);
    const double scale = 1.0 / (2.0 * kStep);
    const Eigen::Vector3d dq =
        scale * so3::log(Eigen::Quaterniond(gyro_down.delta_q.conjugate() * gyro_up.delta_q));
    EXPECT_LT((nominal.dq_dbg.col(axis) - dq).norm(), 1e-5);
    EXPECT_LT((nominal.dv_dbg.col(axis) - scale * (gyro_up.delta_v - gyro_down.delta_v)).norm(), 2e-4);
    EXPECT_LT((nominal.dp_dbg.col(axis) - scale * (gyro_up.delta_p - gyro_down.delta_p)).norm(), 2e-4);
    EXPECT_LT((nominal.dv_dba.col(axis) - scale * (accel_up.delta_v - accel_down.delta_v)).norm(), 1e-8);
    EXPECT_LT((nominal.dp_dba.col(axis) - scale * (accel_up.delta_p - accel_down.delta_p)).norm(), 1e-8);
  }
}

TEST(Preintegration, CovarianceIsThatOfManyNoisyRuns) {
  const auto clean = SyntheticMotion().samples(0.0, 0.2, 200.0);
  const Preintegration nominal = integrate(clean, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  Matrix9d sampled = Matrix9d::Zero();
  constexpr int kRuns = 4000;
  const double rate_root = std::sqrt(200.0);
  for (int run = 0; run < kRuns; ++run) {
    auto noisy = clean;
    for (ImuSample& sample : noisy) {
      // White noise of density d read at rate f has deviation d sqrt(f).
      for (int axis = 0; axis < 3; ++axis) {
        sample.angular_velocity[axis] += kNoise.gyro * rate_root * normal(generator);
        sample.acceleration[axis] += kNoise.accel * rate_root * normal(generator);
      }
    }
    const Preintegration p = integrate(noisy, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    Eigen::Matrix<double, 9, 1> error;
    error << so3::log(Eigen::Quaterniond(nominal.delta_q.conjugate() * p.delta_q)),
        p.delta_p - nominal.delta_p, p.delta_v - nominal.delta_v;
    sampled += error * error.transpose() / kRuns;
  }
  for (int k = 0; k < 9; ++k) {
    // 4000 runs know a deviation to 1.1 %; the end points of the trapezoid weigh half, which is another 2 %.
    EXPECT_NEAR(std::sqrt(sampled(k, k) / nominal.covariance(k, k)), 1.0, 0.08) << "component " << k;
  }
}

TEST(Preintegration, GapInflatesTheCovariance) {
  auto samples = SyntheticMotion().samples(0.0, 0.4, 100.0);
  const Preintegration whole = integrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  samples.erase(samples.begin() + 10, samples.begin() + 30);
  const Preintegration gap = integrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  EXPECT_NEAR(gap.longest_gap_s, 0.21, 1e-6);
  EXPECT_GT(gap.covariance(6, 6), 100.0 * whole.covariance(6, 6));
}

TEST(Preintegration, TwoThatAreJoinedAreThatOfAllReadings) {
  const auto samples = SyntheticMotion().samples(0.0, 0.4, 200.0);
  const Stamp begin = samples.front().stamp;
  const Stamp middle = samples[30].stamp;
  const Stamp end = samples.back().stamp;
  const auto over = [&](Stamp from, Stamp to, const Eigen::Vector3d& gyro_bias) {
    return preintegrate(samples, from, to, {gyro_bias, Eigen::Vector3d(0.05, -0.02, 0.01)}, kNoise,
                        ImuConfig());
  };
  const Eigen::Vector3d bias(0.01, -0.02, 0.03);
  const Preintegration whole = over(begin, end, bias);
  const Preintegration same = joined(over(begin, middle, bias), over(middle, end, bias));
  EXPECT_EQ(same.from, begin);
  EXPECT_EQ(same.to, end);
  EXPECT_EQ(same.sample_count, whole.sample_count);
  EXPECT_LT(same.delta_q.angularDistance(whole.delta_q), 1e-12);
  EXPECT_LT((same.delta_v - whole.delta_v).norm(), 1e-12);
  EXPECT_LT((same.delta_p - whole.delta_p).norm(), 1e-12);
  EXPECT_LT((same.dq_dbg - whole.dq_dbg).norm(), 1e-12);
  EXPECT_LT((same.dv_dbg - whole.dv_dbg).norm(), 1e-12);
  EXPECT_LT((same.dv_dba - whole.dv_dba).norm(), 1e-12);
  EXPECT_LT((same.dp_dbg - whole.dp_dbg).norm(), 1e-12);
  EXPECT_LT((same.dp_dba - whole.dp_dba).norm(), 1e-12);
  // Told by the means of other stretches.
  EXPECT_LT((same.dq_doffset - whole.dq_doffset).norm(), 0.02 * whole.dq_doffset.norm());
  // A step turns with its mean attitude, what is joined with that of its begin: second order in the step.
  EXPECT_LT((same.covariance - whole.covariance).norm(), 1e-4 * whole.covariance.norm());

  const Eigen::Vector3d later_bias = bias + Eigen::Vector3d(1e-3, 1e-3, -1e-3);
  const Preintegration other = joined(over(begin, middle, bias), over(middle, end, later_bias));
  EXPECT_EQ(other.gyro_bias, bias);
  EXPECT_LT(other.delta_q.angularDistance(whole.delta_q), 1e-7);
  EXPECT_LT((other.delta_v - whole.delta_v).norm(), 1e-5);
  EXPECT_LT((other.delta_p - whole.delta_p).norm(), 1e-5);
}

// The derivative by which readings are late, against readings that are.
TEST(Preintegration, TimeOffsetJacobianIsNumeric) {
  const SyntheticMotion motion;
  const auto late_by = [&motion](double offset_s) {
    const auto samples = motion.samples(0.5 + offset_s, 0.6 + offset_s, 1000.0);
    return preintegrate(samples, samples.front().stamp, samples.back().stamp, {}, kNoise, ImuConfig());
  };
  constexpr double kStep = 1e-3;
  const Preintegration p = late_by(0.0);
  const Eigen::Vector3d numeric =
      (so3::log(Eigen::Quaterniond(p.delta_q.conjugate() * late_by(kStep).delta_q)) -
       so3::log(Eigen::Quaterniond(p.delta_q.conjugate() * late_by(-kStep).delta_q))) /
      (2.0 * kStep);
  EXPECT_GT(numeric.norm(), 1e-3);
  EXPECT_LT((p.dq_doffset - numeric).norm(), 1e-4 * (1.0 + numeric.norm())) << p.dq_doffset.transpose();
  const CorrectedDelta moved = corrected(p, {p.gyro_bias, p.accel_bias, p.gyro_scale, 5.0 * kStep});
  EXPECT_LT(moved.delta_q.angularDistance(late_by(5.0 * kStep).delta_q),
            0.05 * p.delta_q.angularDistance(late_by(5.0 * kStep).delta_q));
}

/// Readings of a gyro with such scales, of a motion that is known.
std::vector<ImuSample> misread(std::vector<ImuSample> samples, const Eigen::Matrix3d& gyro_scale) {
  const Eigen::Matrix3d read = (Eigen::Matrix3d::Identity() - gyro_scale).inverse();
  for (ImuSample& sample : samples) sample.angular_velocity = read * sample.angular_velocity;
  return samples;
}

Eigen::Matrix3d some_scale() {
  Eigen::Matrix3d scale;
  scale << 0.02, -0.004, 0.006, 0.003, -0.015, 0.005, -0.007, 0.002, 0.01;
  return scale;
}

TEST(Preintegration, ScalesOfTheGyroAreTakenOut) {
  const SyntheticMotion motion;
  const auto samples = misread(motion.samples(0.5, 1.5, 400.0), some_scale());
  NavState state = motion.state(0.5);
  state.gyro_scale = some_scale();
  const Preintegration p =
      preintegrate(samples, samples.front().stamp, samples.back().stamp, state.errors(), kNoise, ImuConfig());
  const NavState predicted = predict(state, p);
  EXPECT_LT((predicted.t_odom_imu - motion.position(1.5)).norm(), 1e-4);
  EXPECT_LT(predicted.q_odom_imu.angularDistance(motion.attitude(1.5)), 1e-5);
  EXPECT_LT((predicted.w_imu - motion.rate(1.5)).norm(), 1e-9);
  EXPECT_EQ(predicted.gyro_scale, state.gyro_scale);
  // As it is without.
  const Preintegration wrong = integrate(samples, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  EXPECT_GT(predict(motion.state(0.5), wrong).q_odom_imu.angularDistance(motion.attitude(1.5)), 5e-3);

  const auto states = propagate(state, samples, samples.back().stamp);
  EXPECT_LT(states.back().q_odom_imu.angularDistance(motion.attitude(1.5)), 1e-4);
  EXPECT_LT((states.back().w_imu - motion.rate(1.5)).norm(), 1e-9);
}

// To first order, against readings that are integrated with it from the begin.
TEST(Preintegration, OtherScalesOfTheGyroNeedNoReadings) {
  const SyntheticMotion motion;
  const auto samples = motion.samples(0.5, 0.6, 400.0);
  const auto with = [&samples](const Eigen::Matrix3d& scale) {
    return preintegrate(samples, samples.front().stamp, samples.back().stamp,
                        {Eigen::Vector3d(0.01, 0.0, -0.01), Eigen::Vector3d::Zero(), scale}, kNoise,
                        ImuConfig());
  };
  const Preintegration from = with(some_scale());
  const Preintegration to = with(2.0 * some_scale());
  const CorrectedDelta moved = corrected(from, to.errors());
  EXPECT_LT(moved.delta_q.angularDistance(to.delta_q), 0.05 * from.delta_q.angularDistance(to.delta_q));
  EXPECT_LT((moved.delta_v - to.delta_v).norm(), 0.05 * (from.delta_v - to.delta_v).norm());
  EXPECT_LT((moved.delta_p - to.delta_p).norm(), 0.05 * (from.delta_p - to.delta_p).norm());
  const Preintegration both = joined(from, to);
  EXPECT_EQ(both.gyro_scale, from.gyro_scale);
}

/// Against blows of random strength at random instants.
TEST(Preintegration, AnErrorOfVelocityIsOneOfPositionToo) {
  constexpr double kSigma = 2.0;
  Preintegration measured;
  measured.to = add_seconds(measured.from, 0.1);
  measured.covariance = 1e-4 * Matrix15d::Identity();
  const Matrix15d added = with_error(measured, {0.0, kSigma}).covariance - measured.covariance;
  std::mt19937 generator(1);
  std::normal_distribution<double> strength(0.0, kSigma);
  std::uniform_real_distribution<double> left_s(0.0, 0.1);
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  constexpr int kBlows = 100000;
  for (int k = 0; k < kBlows; ++k) {
    const double dv = strength(generator);
    const Eigen::Vector2d error(dv * left_s(generator), dv);
    sum += error * error.transpose() / kBlows;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int p = 3 + axis;
    const int v = 6 + axis;
    EXPECT_NEAR(added(p, p), sum(0, 0), 0.02 * sum(0, 0));
    EXPECT_NEAR(added(p, v), sum(0, 1), 0.02 * sum(0, 1));
    EXPECT_NEAR(added(v, v), sum(1, 1), 0.02 * sum(1, 1));
  }
  EXPECT_NEAR(added.topLeftCorner(3, 3).norm() + added.bottomRightCorner(6, 6).norm(), 0.0, 1e-12);
}

TEST(Preintegration, AnErrorOfTheTurnTurnsWhatWasFelt) {
  Preintegration measured;
  measured.to = add_seconds(measured.from, 0.1);
  measured.delta_v = Eigen::Vector3d(0.0, 0.6, 0.8);
  const Matrix15d added = with_error(measured, {0.05, 0.0}).covariance - measured.covariance;
  const Matrix15d felt = with_error(measured, {0.0, 0.05}).covariance - measured.covariance;
  EXPECT_LT((added.topLeftCorner<3, 3>() - 0.05 * 0.05 * Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_LT((added.bottomRightCorner<12, 12>() - felt.bottomRightCorner<12, 12>()).norm(), 1e-12);
  const Matrix15d both = with_error(measured, {0.05, 0.12}).covariance - measured.covariance;
  EXPECT_NEAR(both(8, 8), 0.13 * 0.13, 1e-12);
}

TEST(Preintegration, NoReadingGivesNoSamples) {
  const Preintegration p = preintegrate({}, 0, to_nanoseconds(0.1), {}, kNoise, ImuConfig());
  EXPECT_EQ(p.sample_count, 0U);
}

TEST(Propagation, FollowsTheTrueMotionAndEndsAtTheAskedInstant) {
  const SyntheticMotion motion;
  const Stamp to = to_nanoseconds(100.7531);
  const auto states = propagate(motion.state(0.25), motion.samples(0.2, 0.8, 200.0), to);
  EXPECT_EQ(states.back().stamp, to);
  EXPECT_LT((states.back().t_odom_imu - motion.position(0.7531)).norm(), 2e-3);
  EXPECT_LT((states.back().w_imu - motion.rate(0.7531)).norm(), 1e-3);
}

TEST(Propagation, TurnsReadingsOfATurnedImuIntoTheAxesOfThePose) {
  SyntheticMotion motion;
  motion.mounting = Eigen::Vector3d(0.3, -0.2, 0.5);
  const auto states = propagate(motion.state(0.25), motion.samples(0.2, 0.8, 200.0), to_nanoseconds(100.75));
  EXPECT_LT((states.back().t_odom_imu - motion.position(0.75)).norm(), 2e-3);
  EXPECT_LT(states.back().q_odom_imu.angularDistance(motion.attitude(0.75)), 1e-4);

  const auto samples = motion.samples(0.5, 0.6, 2000.0);
  const Preintegration p =
      preintegrate(samples, samples.front().stamp, samples.back().stamp, {}, ImuNoise(), ImuConfig());
  const NavState predicted = predict(motion.state(0.5), p);
  EXPECT_LT((predicted.t_odom_imu - motion.position(0.6)).norm(), 1e-5);
  EXPECT_LT((predicted.v_odom - motion.velocity(0.6)).norm(), 1e-4);
  EXPECT_LT(predicted.q_odom_imu.angularDistance(motion.attitude(0.6)), 1e-5);
}

// A state of the scans' clock becomes one of the IMU's, whose readings move it on.
TEST(Propagation, OdometryHasTheStampsOfTheReadings) {
  constexpr double kOffset = 0.03;
  const SyntheticMotion motion;
  Reporter reporter;
  ImuBuffer buffer(SensorConfig(), &reporter);
  for (const ImuSample& sample : motion.samples(0.0, 0.6, 200.0)) buffer.add(sample);
  NavState state = motion.state(0.3);
  state.stamp = add_seconds(state.stamp, -kOffset);
  state.lidar_time_offset_s = kOffset;
  ImuPropagator propagator;
  propagator.set_state(state, buffer);
  const auto moved = propagator.add(motion.sample(0.605));
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->stamp, motion.sample(0.605).stamp);
  EXPECT_LT((moved->t_odom_imu - motion.position(0.605)).norm(), 2e-3);
  EXPECT_LT(moved->q_odom_imu.angularDistance(motion.attitude(0.605)), 1e-4);
}

TEST(Propagation, WithoutReadingsHoldsVelocityAndRate) {
  NavState state;
  state.v_odom = Eigen::Vector3d(1.0, 2.0, 3.0);
  state.w_imu = Eigen::Vector3d(0.0, 0.0, 0.5);
  const auto states = propagate(state, {}, to_nanoseconds(2.0));
  EXPECT_LT((states.back().t_odom_imu - Eigen::Vector3d(2.0, 4.0, 6.0)).norm(), 1e-12);
  EXPECT_LT((so3::log(states.back().q_odom_imu) - Eigen::Vector3d(0.0, 0.0, 1.0)).norm(), 1e-12);
}

}  // namespace
}  // namespace fdi_lio::imu
