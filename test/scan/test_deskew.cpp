#include <cmath>

#include "synthetic_motion.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/imu/propagation.hpp"
#include "fdi_lio/scan/deskew.hpp"

namespace fdi_lio::scan {
namespace {

Eigen::Isometry3d pose(double t) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = imu::SyntheticMotion::attitude(t).toRotationMatrix();
  T.translation() = imu::SyntheticMotion::position(t);
  return T;
}

class TurningSweep : public testing::Test {
 protected:
  TurningSweep() {
    T_imu_lidar_.linear() = so3::exp(Eigen::Vector3d(0.2, -0.1, 1.0));
    T_imu_lidar_.translation() = Eigen::Vector3d(0.3, -0.2, 0.5);
    scan_.stamp = to_nanoseconds(101.0);
    scan_.duration_s = 0.1;
    scan_.has_time = true;
    scan_.ring_count = 4;
    for (int k = 0; k <= 1000; ++k) {
      Point point;
      point.ring = static_cast<std::uint16_t>(k % 4);
      point.time_s = -0.1F + 0.0001F * static_cast<float>(k);
      const Eigen::Vector3d p_odom(10.0 * std::cos(0.02 * k), 8.0 * std::sin(0.02 * k), 0.5 * (k % 4));
      truth_odom_.push_back(p_odom);
      point.position = ((pose(1.0 + point.time_s) * T_imu_lidar_).inverse() * p_odom).cast<float>();
      scan_.points.push_back(point);
    }
  }

  Eigen::Isometry3d T_imu_lidar_ = Eigen::Isometry3d::Identity();
  Scan scan_;
  std::vector<Eigen::Vector3d> truth_odom_;
};

TEST_F(TurningSweep, PutsPointsWhereTheStillWorldIs) {
  const imu::SyntheticMotion motion;
  const auto trajectory = imu::propagate(motion.state(0.9), motion.samples(0.85, 1.05, 400.0), scan_.stamp);
  deskew(&scan_, trajectory, T_imu_lidar_);
  const Eigen::Isometry3d T_odom_lidar = pose(1.0) * T_imu_lidar_;
  for (std::size_t k = 0; k < scan_.points.size(); ++k) {
    EXPECT_LT((T_odom_lidar * scan_.points[k].position.cast<double>() - truth_odom_[k]).norm(), 1e-3) << k;
  }
}

TEST_F(TurningSweep, TellsHowTheLidarMoved) {
  const imu::SyntheticMotion motion;
  const auto trajectory = imu::propagate(motion.state(0.9), motion.samples(0.85, 1.05, 400.0), scan_.stamp);
  const Sweep sweep = deskew(&scan_, trajectory, T_imu_lidar_);
  const Eigen::Isometry3d T_end_odom = (pose(1.0) * T_imu_lidar_).inverse();
  for (const double ago : {0.0, 0.05, 0.25, 0.5, 0.8, 1.0}) {
    const Eigen::Isometry3d T_end_lidar = T_end_odom * pose(1.0 - 0.1 * ago) * T_imu_lidar_;
    const auto share = static_cast<float>(ago);
    EXPECT_LT((sweep.axis(share) - T_end_lidar.linear().col(2).cast<float>()).norm(), 1e-3F) << ago;
    // The way is taken for straight.
    EXPECT_LT((sweep.origin(share) - T_end_lidar.translation().cast<float>()).norm(), 0.01F) << ago;
  }
}

TEST_F(TurningSweep, WithoutTimeOrTrajectoryPointsStay) {
  Scan copy = scan_;
  deskew(&copy, {}, T_imu_lidar_);
  EXPECT_EQ(copy.points[10].position, scan_.points[10].position);
  copy.has_time = false;
  const imu::SyntheticMotion motion;
  deskew(&copy, imu::propagate(motion.state(0.9), motion.samples(0.85, 1.05, 400.0), scan_.stamp),
         T_imu_lidar_);
  EXPECT_EQ(copy.points[10].position, scan_.points[10].position);
}

TEST_F(TurningSweep, OrderIsByRingAndThenByTimeWhateverTheInput) {
  Scan reversed = scan_;
  std::reverse(reversed.points.begin(), reversed.points.end());
  const DeskewedScan a = order_by_ring(scan_);
  const DeskewedScan b = order_by_ring(reversed);
  ASSERT_EQ(a.ring_count(), 4U);
  ASSERT_EQ(a.points.size(), scan_.points.size());
  for (std::size_t ring = 0; ring < 4; ++ring) {
    for (std::uint32_t k = a.ring_begin[ring]; k < a.ring_begin[ring + 1]; ++k) {
      EXPECT_EQ(a.points[k].ring, ring);
      EXPECT_EQ(a.points[k].time_s, b.points[k].time_s);
      if (k > a.ring_begin[ring]) {
        EXPECT_GE(a.points[k].time_s, a.points[k - 1].time_s);
      }
    }
  }
}

TEST(OrderByRing, EmptyScanIsEmpty) {
  EXPECT_EQ(order_by_ring(Scan()).points.size(), 0U);
  EXPECT_EQ(order_by_ring(Scan()).ring_count(), 0U);
}

}  // namespace
}  // namespace fdi_lio::scan
