#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/odometry/map_tilt.hpp"

namespace fdi_lio::odometry {
namespace {

const Eigen::Vector3d kGravity(0.0, 0.0, -9.81);
constexpr double kStepM = 0.5;

/// A pose of the truth `k` steps along a bend, in the level frame of the first one.
Eigen::Isometry3d true_pose(int k) {
  const double turn = 0.004 * k;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3::exp(Eigen::Vector3d(0.0, 0.0, turn));
  T.translation() = kStepM / 0.004 * Eigen::Vector3d(std::sin(turn), 1.0 - std::cos(turn), 0.0);
  return T;
}

/// The same in a frame that has turned by phi: the estimate, and gravity in its frame.
struct TiltedRun {
  imu::NavState state;
  Eigen::Vector3d t_true = Eigen::Vector3d::Zero();

  void go_on(int k, const Eigen::Vector3d& phi) {
    const Eigen::Isometry3d T = true_pose(k);
    const Eigen::Matrix3d turn = so3::exp(phi);
    state.imu_status = imu::ImuStatus::kInitialised;
    state.q_odom_imu = Eigen::Quaterniond(Eigen::Matrix3d(turn * T.linear()));
    state.t_odom_imu += turn * (T.translation() - t_true);
    state.g_odom = turn * kGravity;
    t_true = T.translation();
  }
};

TEST(MapTilt, IsTheErrorOfAMapThatTurnsOnTheWay) {
  TiltedRun run;
  run.go_on(0, Eigen::Vector3d::Zero());
  MapTilt tilt;
  for (int k = 1; k <= 600; ++k) {
    const imu::NavState before = run.state;
    const double late_m = std::max(0.0, kStepM * k - 30.0);
    run.go_on(k, Eigen::Vector3d(6e-5, -3e-5, 0.0) * late_m);
    tilt.advance(before, run.state);
  }
  Vector6d expected;
  expected << so3::log(Eigen::Matrix3d(run.state.q_odom_imu.conjugate() * true_pose(600).linear())),
      run.t_true - run.state.t_odom_imu;
  EXPECT_GT(expected.head<3>().norm(), 0.01);
  EXPECT_GT(expected.tail<3>().norm(), 1.0);
  EXPECT_LT((tilt.error() - expected).head<3>().norm(), 0.02 * expected.head<3>().norm());
  EXPECT_LT((tilt.error() - expected).tail<3>().norm(), 0.02 * expected.tail<3>().norm());
}

/// Gravity that is found in the first metres is no tilt of the map.
TEST(MapTilt, CountsFromWhereGravityIsKnown) {
  TiltedRun run;
  run.go_on(0, Eigen::Vector3d(0.01, 0.0, 0.0));
  MapTilt tilt;
  for (int k = 1; k <= 200; ++k) {
    const imu::NavState before = run.state;
    run.go_on(k, Eigen::Vector3d::Zero());
    tilt.advance(before, run.state);
  }
  EXPECT_LT(tilt.error().norm(), 1e-12);
}

TEST(MapTilt, NothingIsKnownWithoutGravity) {
  MapTilt tilt;
  imu::NavState before;
  imu::NavState now;
  now.t_odom_imu.x() = 100.0;
  tilt.advance(before, now);
  EXPECT_EQ(tilt.error(), Vector6d::Zero());
}

}  // namespace
}  // namespace fdi_lio::odometry
