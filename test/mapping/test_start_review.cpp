#include <cmath>

#include "synthetic_road.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/mapping/start_review.hpp"

namespace fdi_lio::mapping {
namespace {

/// One more scan of a drive that was taken for a stand, `odom` tilted against the road by `tilt` about y. The
/// IMU's axes are those of the road.
void add_scan(const SyntheticRoad& road, int k, double speed_mps, double tilt, StartReview* review,
              double calm_s = ImuConfig().static_duration_s) {
  EstimatorInput input;
  input.features = road.scan(SyntheticRoad::kPeriod_s * k, speed_mps, 0.0, static_cast<unsigned>(k));
  const Eigen::Vector3d felt(road.acceleration_mps2, 0.0, SensorConfig().gravity_mps2);
  input.imu.emplace();
  input.imu->sample_count = 20;
  input.imu->recent.duration_s = calm_s;
  input.imu->to = input.features.stamp;
  input.imu->from = input.features.stamp - static_cast<Stamp>(1e9 * SyntheticRoad::kPeriod_s);
  input.imu->delta_v = SyntheticRoad::kPeriod_s * felt;
  input.imu->delta_p = 0.5 * SyntheticRoad::kPeriod_s * input.imu->delta_v;
  imu::NavState state;
  state.stamp = input.features.stamp;
  state.q_odom_imu = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY());
  review->add(std::move(input), state);
}

TEST(StartReview, FindsTheVelocityAfterEightScans) {
  StartReview review{Config()};
  for (int k = 0; k < 7; ++k) {
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &review);
    EXPECT_FALSE(review.find_motion(false));
    EXPECT_FALSE(review.is_over());
  }
  add_scan(SyntheticRoad(), 7, 22.0, 0.0, &review);
  const auto start = review.find_motion(false);
  ASSERT_TRUE(start);
  EXPECT_TRUE(review.is_over());
  EXPECT_EQ(review.inputs().size(), 8U);
  EXPECT_LT((start->v_odom - Eigen::Vector3d(22.0, 0.0, 0.0)).norm(), 0.5);
  EXPECT_FALSE(start->up_by_ground);
}

/// An accelerometer that feels 3 m/s^2 backwards takes the road for a slope.
TEST(StartReview, WhoGathersSpeedStandsUprightByTheGround) {
  SyntheticRoad road;
  road.acceleration_mps2 = 3.0;
  const SensorConfig sensor;
  const double tilt = -std::atan2(road.acceleration_mps2, sensor.gravity_mps2);
  StartReview review{Config()};
  for (int k = 0; k < 8; ++k) add_scan(road, k, 15.0, tilt, &review);
  const auto start = review.find_motion(false);
  ASSERT_TRUE(start);
  const Eigen::Matrix3d R_odom_road = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY()).toRotationMatrix();
  ASSERT_TRUE(start->up_by_ground);
  EXPECT_GT(start->up_by_ground->dot(R_odom_road.col(2)), std::cos(0.02));
  EXPECT_LT((start->v_odom - 15.0 * R_odom_road.col(0)).norm(), 0.7);
}

TEST(StartReview, WaitsWhileACalmImuMayYetSayThatTheSensorStands) {
  StartReview review{Config()};
  for (int k = 0; k < 8; ++k)
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &review, 0.5 * ImuConfig().static_duration_s);
  EXPECT_FALSE(review.find_motion(false));
  EXPECT_FALSE(review.is_over());
  add_scan(SyntheticRoad(), 8, 22.0, 0.0, &review);
  EXPECT_TRUE(review.find_motion(false));
}

TEST(StartReview, IsOverWhenTheScansSayNothing) {
  SyntheticRoad road;
  road.roughness = 0.0;
  StartReview review{Config()};
  for (int k = 0; k < 16; ++k) {
    EXPECT_FALSE(review.is_over()) << k;
    add_scan(road, k, 22.0, 0.0, &review);
    EXPECT_FALSE(review.find_motion(false)) << k;
  }
  EXPECT_TRUE(review.is_over());
}

}  // namespace
}  // namespace fdi_lio::mapping
