#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "synthetic_places.hpp"
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "fdi_lio/mapping/global_optimizer.hpp"

namespace fdi_lio::mapping {
namespace {

/// Keyframes every 2 m round a square of 50 m, as often as wanted, with drifting odometry.
struct Drive {
  Drive(unsigned town_seed, double laps, double yaw_error_rad_per_m) {
    const SyntheticWorld town = make_town(town_seed);
    Eigen::Isometry3d T_odom = Eigen::Isometry3d::Identity();
    const int count = static_cast<int>(laps * 100.0);
    for (int k = 0; k < count; ++k) {
      const int side = k / 25 % 4;
      const Eigen::Isometry3d corner = planar_pose(25.0, -25.0, 0.5 * M_PI);
      const Eigen::Isometry3d T =
          planar_pose(0.0, 0.0, 0.5 * M_PI * side) * corner * planar_pose(2.0 * (k % 25), 0.0, 0.0);
      if (!truth.empty())
        T_odom = T_odom * truth.back().inverse() * T * planar_pose(0.0, 0.0, 2.0 * yaw_error_rad_per_m);
      truth.push_back(T);
      Keyframe keyframe;
      keyframe.stamp = 1000000000LL * k;
      keyframe.T_odom_imu = T_odom;
      keyframe.covariance = 1e-8 * Matrix6d::Identity();
      keyframe.cloud = town.seen_from(T, static_cast<unsigned>(k));
      keyframes.push_back(keyframe);
    }
  }

  /// How far the poses of the last keyframes are from where they were a lap before, beyond the truth.
  double worst_revisit(const GlobalOptimizer& global) const {
    double worst = 0.0;
    for (std::size_t k = 110; k < global.size(); ++k) {
      const Eigen::Isometry3d seen = global.T_map_imu(k - 100).inverse() * global.T_map_imu(k);
      worst = std::max(worst, seen.translation().norm());
    }
    return worst;
  }

  std::vector<Eigen::Isometry3d> truth;
  std::vector<Keyframe> keyframes;
};

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
  const Drive drive(1, 1.3, 4e-4);
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

TEST(GlobalOptimizer, SameInputGivesTheSameBitsWithAnyNumberOfThreads) {
  const Drive drive(2, 1.15, 4e-4);
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
  const Drive drive(1, 1.3, 4e-4);
  Reporter reporter;
  GlobalOptimizer global(Config(), &reporter);
  for (const Keyframe& keyframe : drive.keyframes) global.add(keyframe);
  const Keyframe& keyframe = drive.keyframes[112];
  const Eigen::Isometry3d T_step = planar_pose(0.5, 0.0, 0.01);
  const Eigen::Isometry3d T = global.correct(keyframe.stamp + 1000, keyframe.T_odom_imu * T_step);
  EXPECT_TRUE(T.isApprox(global.T_map_imu(112) * T_step, 1e-9));
}

TEST(GlobalOptimizer, NothingIsNoError) {
  Reporter reporter;
  const GlobalOptimizer global(Config(), &reporter);
  EXPECT_TRUE(global.T_map_odom().isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_TRUE(global.correct(5, planar_pose(1, 2, 3)).isApprox(planar_pose(1, 2, 3)));
}

}  // namespace
}  // namespace fdi_lio::mapping
