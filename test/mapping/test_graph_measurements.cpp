#include <cmath>
#include <vector>

#include "synthetic_places.hpp"
#include <GeographicLib/LocalCartesian.hpp>
#include <gtest/gtest.h>

#include "fdi_lio/mapping/graph_measurements.hpp"

namespace fdi_lio::mapping {
namespace {

/// A drive along two sides of a square, a keyframe every 2 m and second, whose odometry is right, and fixes
/// half a second after each.
class Measurements : public testing::Test {
 protected:
  Measurements() {
    for (int k = 0; k < 100; ++k) {
      const Eigen::Isometry3d T =
          k < 50 ? planar_pose(2.0 * k, 0.0, 0.0) : planar_pose(100.0, 2.0 * (k - 50), 0.5 * M_PI);
      frames_.push_back({1000000000LL * k, T, 2.0 * k, false});
      poses_.push_back(T);
      graph_.add_node(T);
    }
  }

  /// Between frames k and k + 1, `error` off.
  GnssFix fix_after(std::size_t k, const Eigen::Vector3d& error) const {
    const Eigen::Vector3d between = 0.5 * (poses_[k].translation() + poses_[k + 1].translation());
    const Eigen::Vector3d p = T_enu_map_ * between + error;
    GnssFix fix;
    fix.stamp = frames_[k].stamp + 500000000LL;
    fix.status = 0;
    earth_.Reverse(p.x(), p.y(), p.z(), fix.latitude_deg, fix.longitude_deg, fix.altitude_m);
    return fix;
  }

  const GeographicLib::LocalCartesian earth_{49.0, 8.4, 115.0};
  const Eigen::Isometry3d T_enu_map_ = Eigen::Translation3d(20.0, -5.0, 3.0) * planar_pose(0.0, 0.0, 0.7);
  Reporter reporter_;
  PoseGraph graph_{PoseGraphSettings()};
  std::vector<OdometryFrame> frames_;
  std::vector<Eigen::Isometry3d> poses_;
};

TEST_F(Measurements, FixesAlignTheMapAndSayItsHeight) {
  GraphMeasurements measurements(Config(), &reporter_);
  for (std::size_t k = 0; k < 48; ++k) {
    // The first heights, which the map is aligned with, are off by 5 m; each twentieth fix is wrong
    // altogether.
    const double height = k < 16 ? 5.0 : 0.5 * std::sin(1.7 * static_cast<double>(k));
    const Eigen::Vector3d error =
        k % 20 == 19 ? Eigen::Vector3d(25.0, 10.0, 40.0) : Eigen::Vector3d(0.0, 0.0, height);
    measurements.add_fix(fix_after(k, error));
  }
  int solves = 0;
  while (measurements.use(frames_, poses_, &graph_)) {
    measurements.solved();
    ++solves;
  }
  EXPECT_GT(solves, 1);
  ASSERT_TRUE(measurements.is_aligned());
  ASSERT_EQ(measurements.fixes().size(), 48U);
  EXPECT_EQ(measurements.fixes()[39].verdict, GnssVerdict::kOutlier);
  EXPECT_EQ(measurements.fixes()[40].verdict, GnssVerdict::kAccepted);
  ASSERT_TRUE(measurements.enu_origin());
  const GnssFix first = fix_after(0, Eigen::Vector3d::Zero());
  EXPECT_NEAR(measurements.enu_origin()->latitude_deg, first.latitude_deg, 1e-9);
  const EnuAlignment alignment = measurements.with_height(graph_.alignment(), poses_);
  EXPECT_NEAR(alignment.yaw_rad, 0.7, 0.01);
  // The origin is the first fix, 1 m along the way and 5 m too high.
  const Eigen::Vector3d expected = -(T_enu_map_.linear() * Eigen::Vector3d(1.0, 0.0, 0.0));
  EXPECT_LT((alignment.t_enu_map - expected).head<2>().norm(), 0.3);
  EXPECT_GT(graph_.alignment().t_enu_map.z(), -2.0);
  EXPECT_NEAR(alignment.t_enu_map.z(), -5.0, 0.5);
}

TEST_F(Measurements, AltitudesThatMoveTheMapSayItThemselves) {
  Config config;
  config.gnss.use_altitude = true;
  GraphMeasurements measurements(config, &reporter_);
  for (std::size_t k = 0; k < 48; ++k) measurements.add_fix(fix_after(k, Eigen::Vector3d::Zero()));
  while (measurements.use(frames_, poses_, &graph_)) measurements.solved();
  ASSERT_TRUE(measurements.is_aligned());
  EnuAlignment alignment;
  alignment.t_enu_map.z() = 4.0;
  EXPECT_EQ(measurements.with_height(alignment, poses_).t_enu_map.z(), 4.0);
}

TEST_F(Measurements, FixesWaitForTheirFramesAndThoseFromBeforeTheStartAreDropped) {
  GraphMeasurements measurements(Config(), &reporter_);
  const OdometryFrame next_frame = frames_[10];
  const Eigen::Isometry3d next_pose = poses_[10];
  frames_.resize(10);
  poses_.resize(10);
  GnssFix early = fix_after(0, Eigen::Vector3d::Zero());
  early.stamp = -1;
  measurements.add_fix(early);
  for (std::size_t k = 0; k < 9; ++k) measurements.add_fix(fix_after(k, Eigen::Vector3d::Zero()));
  GnssFix late = fix_after(8, Eigen::Vector3d::Zero());
  late.stamp = frames_.back().stamp + 1;
  measurements.add_fix(late);
  EXPECT_FALSE(measurements.use(frames_, poses_, &graph_));
  EXPECT_EQ(measurements.fixes().size(), 9U);
  frames_.push_back(next_frame);
  poses_.push_back(next_pose);
  EXPECT_FALSE(measurements.use(frames_, poses_, &graph_));
  ASSERT_EQ(measurements.fixes().size(), 10U);
  EXPECT_EQ(measurements.fixes().back().stamp, late.stamp);
}

}  // namespace
}  // namespace fdi_lio::mapping
