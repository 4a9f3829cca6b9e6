#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "synthetic_drive.hpp"
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"

namespace fdi_lio::mapping {
namespace {

/// The candidates, for messages of failed tests.
std::string describe(const GlobalOptimizer& global) {
  std::ostringstream out;
  for (const LoopCandidate& loop : global.loops()) {
    out << loop.measured.from << " -> " << loop.measured.to << " " << to_text(loop.source) << " "
        << to_text(loop.verdict) << " overlap " << loop.overlap << " walls " << loop.wall_share
        << " residual " << loop.residual_m << " weak " << loop.weak_directions << " chi-square "
        << loop.chi_square << "\n";
  }
  return out.str();
}

TEST(GlobalOptimizer, SecondLapClosesTheLoop) {
  const SyntheticDrive drive(1, 1.3, 4e-4);
  Config config;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  config.loop.enabled = false;
  GlobalOptimizer odometry_only(config, &reporter);
  for (const Keyframe& keyframe : drive.keyframes) {
    global.add(keyframe);
    odometry_only.add(keyframe);
  }
  EXPECT_GT(drive.worst_revisit(odometry_only), 1.5);
  EXPECT_LT(drive.worst_revisit(global), 0.15);
  EXPECT_GT(global.graph().loops.size(), 3U) << describe(global);
  EXPECT_TRUE(odometry_only.loops().empty());
  EXPECT_FALSE(global.T_map_odom().isApprox(Eigen::Isometry3d::Identity(), 1e-3));
}

/// Loops that say what the map knows already wait for others; in the end nothing is different.
TEST(GlobalOptimizer, LoopsThatAgreeAreSolvedTogether) {
  const SyntheticDrive drive(1, 2.2, 2e-5);
  const auto run = [&drive](int solve_every, int* changes) {
    Config config;
    config.loop.solve_every = solve_every;
    Reporter reporter;
    GlobalOptimizer global(config, &reporter);
    *changes = 0;
    for (const Keyframe& keyframe : drive.keyframes) {
      const Eigen::Isometry3d before = global.T_map_odom();
      global.add(keyframe);
      if (!global.T_map_odom().isApprox(before, 1e-12)) ++*changes;
    }
    global.finish();
    return global.graph();
  };
  int changes_at_once = 0;
  int changes_together = 0;
  const GraphFile at_once = run(1, &changes_at_once);
  const GraphFile together = run(10, &changes_together);
  EXPECT_LT(2 * changes_together, changes_at_once);
  EXPECT_EQ(together.loops.size(), at_once.loops.size());
  for (std::size_t k = 0; k < together.poses.size(); ++k)
    EXPECT_LT(difference(together.poses[k], at_once.poses[k]).norm(), 0.02) << k;
}

/// With 400 keyframes at least two lie between optimisations, though each has a loop that contradicts; what
/// waits is taken in when asked for.
TEST(GlobalOptimizer, ALargeGraphIsOptimisedLessOften) {
  SyntheticDrive drive(1, 4.2, 2e-4);
  // As good as they are: no step is corrected (OdometryCheck), which would move the map too.
  for (Keyframe& keyframe : drive.keyframes) keyframe.covariance = 1e-5 * Matrix6d::Identity();
  Config config;
  config.loop.spacing_m = 0.5;
  config.loop.min_path_m = 750.0;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  int consecutive = 0;
  int changes = 0;
  bool has_changed = false;
  for (const Keyframe& keyframe : drive.keyframes) {
    const Eigen::Isometry3d before = global.T_map_odom();
    global.add(keyframe);
    const bool changes_now = !global.T_map_odom().isApprox(before, 1e-12);
    if (global.size() > 400) {
      changes += changes_now ? 1 : 0;
      consecutive += changes_now && has_changed ? 1 : 0;
    }
    has_changed = changes_now;
  }
  EXPECT_GT(changes, 2);
  EXPECT_EQ(consecutive, 0);
  global.optimise();
  for (const LoopCandidate& loop : global.loops())
    EXPECT_NE(loop.verdict, LoopVerdict::kPending) << describe(global);
  EXPECT_LT(drive.worst_revisit(global), 0.15);
}

TEST(GlobalOptimizer, SameInputGivesTheSameBitsWithAnyNumberOfThreads) {
  const SyntheticDrive drive(2, 1.15, 4e-4);
  const auto run = [&drive](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Reporter reporter;
    GlobalOptimizer global(Config(), &reporter);
    for (const Keyframe& keyframe : drive.keyframes) global.add(keyframe);
    return global.graph();
  };
  const GraphFile one = run(1);
  const GraphFile two = run(2);
  ASSERT_GT(one.loops.size(), 0U);
  ASSERT_EQ(one.loops.size(), two.loops.size());
  for (std::size_t k = 0; k < one.poses.size(); ++k) EXPECT_EQ(one.poses[k].matrix(), two.poses[k].matrix());
}

TEST(GlobalOptimizer, ScansMoveWithTheKeyframeBefore) {
  const SyntheticDrive drive(1, 1.3, 4e-4);
  Reporter reporter;
  GlobalOptimizer global(Config(), &reporter);
  for (const Keyframe& keyframe : drive.keyframes) global.add(keyframe);
  const Keyframe& keyframe = drive.keyframes[112];
  const Eigen::Isometry3d T_step = planar_pose(0.5, 0.0, 0.01);
  const Eigen::Isometry3d T = global.correct(keyframe.stamp + 1000, keyframe.T_odom_imu * T_step);
  EXPECT_TRUE(T.isApprox(global.T_map_imu(112) * T_step, 1e-9));
}

/// Keyframes every 2 m straight ahead, without clouds; each step of the odometry is off by `error`.
std::vector<Keyframe> straight_drive(int count, const Eigen::Isometry3d& error, const Matrix6d& covariance) {
  std::vector<Keyframe> keyframes;
  Eigen::Isometry3d T_odom = Eigen::Isometry3d::Identity();
  for (int k = 0; k < count; ++k) {
    Keyframe keyframe;
    keyframe.stamp = 1000000000LL * k;
    keyframe.T_odom_imu = T_odom;
    keyframe.covariance = covariance;
    keyframes.push_back(keyframe);
    T_odom = T_odom * planar_pose(2.0, 0.0, 0.0) * error;
  }
  return keyframes;
}

/// What wheels say of that drive ten times a second: `scale` times the truth, with a slip of `slip_m` once.
std::vector<ExternalPose> wheels_of_straight_drive(int count, double slip_m, double scale = 1.0) {
  std::vector<ExternalPose> poses;
  for (int k = 0; k < 10 * count; ++k) {
    ExternalPose pose;
    pose.stamp = 100000000LL * k;
    pose.T_world_child = planar_pose(scale * 0.2 * k + (k > 500 ? slip_m : 0.0), 0.0, 0.0);
    poses.push_back(pose);
  }
  return poses;
}

Config without_loops() {
  Config config;
  config.loop.enabled = false;
  config.external_odometry.enabled = true;
  return config;
}

/// In a tunnel the odometry does not know the way along the axis, and says so.
TEST(GlobalOptimizer, WheelsMeasureWhatTheOdometryDoesNotKnow) {
  Matrix6d covariance = 1e-8 * Matrix6d::Identity();
  covariance(3, 3) = 100.0;
  const std::vector<Keyframe> drive = straight_drive(100, planar_pose(-0.1, 0.0, 0.0), covariance);
  Reporter reporter;
  GlobalOptimizer global(without_loops(), &reporter);
  const std::vector<ExternalPose> wheels = wheels_of_straight_drive(100, 0.0);
  std::size_t next = 0;
  for (const Keyframe& keyframe : drive) {
    global.add(keyframe);
    // Messages come a little after the keyframe that needs them.
    while (next < wheels.size() && wheels[next].stamp <= keyframe.stamp + 300000000LL)
      global.add_external(wheels[next++]);
  }
  global.finish();
  EXPECT_NEAR(drive.back().T_odom_imu.translation().x(), 188.1, 1e-6);
  EXPECT_NEAR(global.T_map_imu(99).translation().x(), 198.0, 0.1);
  EXPECT_LT(global.T_map_imu(99).translation().tail<2>().norm(), 0.01);
}

/// The odometry knows a step to 0.1 m.
TEST(GlobalOptimizer, WheelsThatSlipAreNotBelieved) {
  Matrix6d covariance = 1e-8 * Matrix6d::Identity();
  covariance(3, 3) = 0.01;
  Reporter reporter;
  GlobalOptimizer global(without_loops(), &reporter);
  for (const ExternalPose& pose : wheels_of_straight_drive(100, 5.0)) global.add_external(pose);
  for (const Keyframe& keyframe : straight_drive(100, Eigen::Isometry3d::Identity(), covariance))
    global.add(keyframe);
  global.finish();
  EXPECT_NEAR(global.T_map_imu(99).translation().x(), 198.0, 0.1);
}

/// Before the tunnel the odometry shows that the wheels say 2 % too much.
TEST(GlobalOptimizer, ScaleOfTheWheelsIsFoundWhereTheOdometryIsGood) {
  std::vector<Keyframe> drive =
      straight_drive(100, Eigen::Isometry3d::Identity(), 1e-8 * Matrix6d::Identity());
  for (std::size_t k = 50; k < drive.size(); ++k) {
    drive[k].T_odom_imu.translation().x() -= 0.1 * static_cast<double>(k - 49);
    drive[k].covariance(3, 3) = 1.0;
  }
  Reporter reporter;
  GlobalOptimizer global(without_loops(), &reporter);
  for (const ExternalPose& pose : wheels_of_straight_drive(100, 0.0, 1.02)) global.add_external(pose);
  for (const Keyframe& keyframe : drive) global.add(keyframe);
  global.finish();
  EXPECT_NEAR(global.external_scale(), 1.0 / 1.02, 2e-3);
  EXPECT_NEAR(global.T_map_imu(99).translation().x(), 198.0, 0.3);
}

TEST(GlobalOptimizer, WheelsDoNotSpoilAGoodOdometry) {
  const std::vector<Keyframe> drive =
      straight_drive(100, Eigen::Isometry3d::Identity(), 1e-8 * Matrix6d::Identity());
  Reporter reporter;
  GlobalOptimizer global(without_loops(), &reporter);
  for (const ExternalPose& pose : wheels_of_straight_drive(100, 0.0, 1.02)) global.add_external(pose);
  for (const Keyframe& keyframe : drive) global.add(keyframe);
  global.finish();
  EXPECT_NEAR(global.T_map_imu(99).translation().x(), 198.0, 0.5);
}

TEST(GlobalOptimizer, ABrokenMessageOfTheWheelsIsReported) {
  Reporter reporter;
  GlobalOptimizer global(without_loops(), &reporter);
  ExternalPose pose;
  global.add_external(pose);
  global.add_external(pose);  // the same stamp
  ASSERT_TRUE(reporter.has("external_odometry"));
  EXPECT_EQ(reporter.notices().at("external_odometry").count, 1U);
}

/// The other odometry claims a climb by 0.02 degrees of pitch a metre, and the odometry alone does not know.
TEST(GlobalOptimizer, GravityKeepsTheMapLevel) {
  std::vector<Keyframe> drive = straight_drive(100, Eigen::Isometry3d::Identity(), isotropic(0.1, 0.1));
  drive[3].down_imu = Eigen::Vector3d(0.0, 0.0, -1.0);
  const auto height = [&drive](double gravity_sigma_deg) {
    Config config = without_loops();
    config.loop.gravity_sigma_deg = gravity_sigma_deg;
    Reporter reporter;
    GlobalOptimizer global(config, &reporter);
    for (const Keyframe& keyframe : drive) global.add(keyframe);
    ExternalPose pose;
    for (int k = 0; k < 1000; ++k) {
      global.add_external(pose);
      pose.stamp += 100000000LL;
      pose.T_world_child.translate(Eigen::Vector3d(0.2, 0.0, 0.0));
      pose.T_world_child.rotate(so3::exp_q(Eigen::Vector3d(0.0, -7e-5, 0.0)));
    }
    global.finish();
    return global.T_map_imu(99).translation().z();
  };
  const double tilted = height(0.0);
  EXPECT_GT(tilted, 3.0);
  EXPECT_LT(std::abs(height(0.2)), 0.2 * tilted);
  // Now the odometry pitches likewise, but each keyframe knows better.
  const Eigen::Isometry3d step(Eigen::Translation3d(2.0, 0.0, 0.0) *
                               so3::exp_q(Eigen::Vector3d(0.0, -7e-4, 0.0)));
  for (std::size_t k = 0; k < drive.size(); ++k) {
    if (k > 0) drive[k].T_odom_imu = drive[k - 1].T_odom_imu * step;
    drive[k].down_imu = Eigen::Vector3d(0.0, 0.0, -1.0);
  }
  EXPECT_GT(height(0.0), 3.0);
  EXPECT_LT(std::abs(height(0.2)), 0.2 * tilted);
}

TEST(GlobalOptimizer, CloudsMakeRoomForTheGraph) {
  const SyntheticDrive drive(1, 1.3, 0.0);
  Config config;
  config.loop.enabled = false;
  config.loop.cloud_memory_mb = 3;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  const std::size_t whole = std::size_t{3} << 20U;
  EXPECT_EQ(global.cloud_memory_bytes(), whole);
  for (const Keyframe& keyframe : drive.keyframes) {
    const std::size_t graph = 40 * 1024 * global.size();
    global.add(keyframe);
    EXPECT_EQ(global.cloud_memory_bytes(), std::max(whole / 10, whole - std::min(whole, graph)));
  }
  for (std::size_t k = 0; k < global.size(); ++k)
    EXPECT_EQ(global.cloud(k)->surface.size(), drive.keyframes[k].cloud.surface.size());
}

TEST(GlobalOptimizer, NothingIsNoError) {
  Reporter reporter;
  const GlobalOptimizer global(Config(), &reporter);
  EXPECT_TRUE(global.T_map_odom().isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_TRUE(global.correct(5, planar_pose(1, 2, 3)).isApprox(planar_pose(1, 2, 3)));
}

}  // namespace
}  // namespace fdi_lio::mapping
