#include "fdi_lio/simulation/trajectory.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/route.hpp"

namespace fdi_lio::simulation {
namespace {

Trajectory random_trajectory(std::uint64_t seed) {
  Random random(seed);
  std::vector<PoseVector> poses;
  PoseVector pose = PoseVector::Zero();
  for (int i = 0; i < 60; ++i) {
    for (int k = 0; k < 3; ++k) pose[k] += random.uniform(-1.0, 1.0);
    for (int k = 3; k < 6; ++k) pose[k] = random.uniform(-0.8, 0.8) + (k == 5 ? 0.2 * i : 0.0);
    poses.push_back(pose);
  }
  return Trajectory(poses, 0.25);
}

class TrajectoryDerivatives : public testing::TestWithParam<std::uint64_t> {};

TEST_P(TrajectoryDerivatives, AgreeWithFiniteDifferences) {
  const Trajectory trajectory = random_trajectory(GetParam());
  constexpr double kStep = 1e-5;
  for (double t = 0.1; t < 14.0; t += 0.137) {
    const MotionState before = trajectory.evaluate(t - kStep), now = trajectory.evaluate(t),
                      after = trajectory.evaluate(t + kStep);
    const Eigen::Vector3d v =
        (after.T_map_imu.translation() - before.T_map_imu.translation()) / (2.0 * kStep);
    const Eigen::Vector3d a = (after.v_map - before.v_map) / (2.0 * kStep);
    const Eigen::Matrix3d turn = before.T_map_imu.linear().transpose() * after.T_map_imu.linear();
    EXPECT_LT((now.v_map - v).norm(), 1e-6) << t;
    EXPECT_LT((now.a_map - a).norm(), 1e-5) << t;
    EXPECT_LT((now.w_imu - so3::log(turn) / (2.0 * kStep)).norm(), 1e-6) << t;
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, TrajectoryDerivatives, testing::Values(1, 2, 3));

TEST(Trajectory, AccelerationHasNoJumpsAtKnots) {
  const Trajectory trajectory = random_trajectory(7);
  for (int knot = 1; knot < 50; ++knot) {
    const double t = 0.25 * knot;
    EXPECT_LT((trajectory.evaluate(t + 1e-9).a_map - trajectory.evaluate(t - 1e-9).a_map).norm(), 1e-5);
  }
}

TEST(Trajectory, KeepsItsSpeedBeyondItsEnds) {
  const std::vector<PoseVector> poses = [] {
    std::vector<PoseVector> way(20, PoseVector::Zero());
    for (std::size_t i = 0; i < way.size(); ++i) way[i][0] = 3.0 * static_cast<double>(i);
    return way;
  }();
  const Trajectory steady(poses, 0.1);  // 30 m/s along x
  for (const double t : {-5.0, -0.1, 0.0, 0.05, 1.0, 1.9, 2.0, 50.0}) {
    const MotionState state = steady.evaluate(t);
    EXPECT_NEAR(state.T_map_imu.translation().x(), 30.0 * t, 1e-9) << t;
    EXPECT_LT((state.v_map - Eigen::Vector3d(30.0, 0.0, 0.0)).norm(), 1e-9) << t;
    EXPECT_LT(state.a_map.norm(), 1e-9) << t;
  }
}

TEST(Trajectory, ThatEndsStandingStaysThere) {
  std::vector<PoseVector> poses(20, PoseVector::Zero());
  for (std::size_t i = 5; i < 15; ++i) poses[i][1] = 0.2 * static_cast<double>(i - 5);
  for (std::size_t i = 15; i < 20; ++i) poses[i][1] = 2.0;
  const Trajectory trajectory(poses, 0.1);
  EXPECT_LT(trajectory.evaluate(-10.0).T_map_imu.translation().norm(), 1e-12);
  EXPECT_NEAR(trajectory.evaluate(100.0).T_map_imu.translation().y(), 2.0, 1e-12);
}

TEST(Trajectory, RevisitBeginsAtRestOnTheWayAndGoesOnOrBack) {
  const Trajectory drive = random_trajectory(4);
  constexpr double kBegin = 5.0;
  for (const bool reversed : {false, true}) {
    const Trajectory again = revisit(drive, kBegin, reversed, 9.0);
    EXPECT_LT((again.pose(1.0).translation() - drive.pose(kBegin).translation()).norm(), 0.02) << reversed;
    EXPECT_LT(again.evaluate(1.0).v_map.norm(), 1e-3) << reversed;
    // From 2 + 5 s on it has passed 2.5 s of the first drive, and goes at its speed.
    const double passed = reversed ? kBegin - 3.5 : kBegin + 3.5;
    EXPECT_LT((again.pose(8.0).translation() - drive.pose(passed).translation()).norm(), 0.02) << reversed;
    const Eigen::Matrix3d turn = drive.pose(passed).linear().transpose() * again.pose(8.0).linear();
    const Eigen::Matrix3d expected =
        Eigen::AngleAxisd(reversed ? M_PI : 0.0, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    EXPECT_LT(so3::log(Eigen::Matrix3d(expected.transpose() * turn)).norm(), 0.05) << reversed;
  }
}

TEST(Drive, KeepsToSpeedAccelerationAndStandstill) {
  MotionSettings motion;
  motion.vibration = 0.0;
  const Route route({{0, 0}, {150, 0}, {150, 100}, {0, 100}}, 10.0, true);
  const Ground level = [](double, double) { return 0.0; };
  const Trajectory trajectory = drive(route, level, motion, 20.0, 60.0, 5);
  for (double t = 0.0; t < motion.stand_s; t += 0.1)
    EXPECT_LT(trajectory.evaluate(t).v_map.norm(), 0.02) << t;
  double top_speed = 0.0;
  for (double t = 0.0; t < 60.0; t += 0.05) {
    const MotionState state = trajectory.evaluate(t);
    const Eigen::Vector3d a_imu = state.T_map_imu.linear().transpose() * state.a_map;
    top_speed = std::max(top_speed, state.v_map.norm());
    EXPECT_LT(std::abs(a_imu.x()), 3.0) << t;
    EXPECT_LT(std::abs(a_imu.y()), 3.2) << t;
    const Eigen::Vector3d v_imu = state.T_map_imu.linear().transpose() * state.v_map;
    EXPECT_LT(std::abs(v_imu.y()), 0.05 * v_imu.x() + 0.05) << "a car does not slide; t " << t;
  }
  EXPECT_NEAR(top_speed, motion.speed_mps, 0.3);
}

TEST(Drive, ClosedRouteComesBack) {
  const Route route({{0, 0}, {60, 0}, {60, 40}, {0, 40}}, 8.0, true);
  const Route::Point first = route.at(10.0), second = route.at(10.0 + route.length());
  EXPECT_LT((first.position - second.position).norm(), 1e-9);
  EXPECT_NEAR(second.heading - first.heading, 2.0 * M_PI, 1e-9);
}

}  // namespace
}  // namespace fdi_lio::simulation
