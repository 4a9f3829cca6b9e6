#include <cmath>
#include <vector>

#include "synthetic_road.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/odometry/start_review.hpp"

namespace fdi_lio::odometry {
namespace {

/// Posts beside the road, seen `way_m` farther on along the first axis.
std::vector<Point> posts(double way_m) {
  std::vector<Point> points;
  for (const double x : {-23.0, -17.5, -11.0, -4.2, 3.0, 8.5, 16.0, 22.5}) {
    for (const double y : {-6.0, 5.0}) {
      for (int k = 0; k < 160; ++k) {
        Point point;
        point.position = Eigen::Vector3d(x + 0.3 * y - way_m, y, -1.5 + 0.025 * k).cast<float>();
        points.push_back(point);
      }
    }
  }
  return points;
}

/// One more scan of a drive that was taken for one with `taken_mps`, or a stand, `odom` tilted against the
/// road by `tilt` about y. The IMU's axes are those of the road.
void add_scan(const SyntheticRoad& road, int k, double speed_mps, double tilt, StartReview* review,
              double calm_s = ImuConfig().static_duration_s,
              const Eigen::Vector3d& information = Eigen::Vector3d::Zero(),
              const std::vector<Point>& edges = {}, double taken_mps = 0.0) {
  EstimatorInput input;
  input.features = road.scan(SyntheticRoad::kPeriod_s * k, speed_mps, 0.0, static_cast<unsigned>(k));
  input.features.edges = edges;
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
  state.t_odom_imu.x() = SyntheticRoad::kPeriod_s * k * taken_mps;
  review->add(std::move(input), state, information.asDiagonal());
}

TEST(StartReview, FindsTheVelocityAfterEightScans) {
  StartReview review{Config()};
  for (int k = 0; k < 7; ++k) {
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &review);
    EXPECT_FALSE(review.find_motion(false, false));
    EXPECT_FALSE(review.is_over());
  }
  add_scan(SyntheticRoad(), 7, 22.0, 0.0, &review);
  const auto start = review.find_motion(false, false);
  ASSERT_TRUE(start);
  EXPECT_TRUE(review.is_over());
  EXPECT_EQ(review.inputs().size(), 8U);
  add_scan(SyntheticRoad(), 8, 22.0, 0.0, &review);
  EXPECT_EQ(review.inputs().size(), 9U);
  EXPECT_FALSE(review.find_motion(false, false));
  EXPECT_LT((start->v_odom - Eigen::Vector3d(22.0, 0.0, 0.0)).norm(), 0.5);
  EXPECT_LT((start->up_odom - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_LT(start->sigma.gravity, 0.2);
}

/// What was estimated, rest, is wrong along a direction only that the surfaces leave open.
TEST(StartReview, BelievesSurfacesAcrossTheDirectionThatTheyLeaveOpen) {
  const double calm_s = ImuConfig().static_duration_s;
  StartReview along{Config()};
  StartReview across{Config()};
  StartReview neither{Config()};
  for (int k = 0; k < 8; ++k) {
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &along, calm_s, {10.0, 1000.0, 1000.0});
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &across, calm_s, {1000.0, 10.0, 1000.0});
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &neither, calm_s, {500.0, 1000.0, 1000.0});
  }
  for (StartReview* review : {&along, &neither}) {
    const auto start = review->find_motion(false, false);
    ASSERT_TRUE(start);
    EXPECT_LT((start->v_odom - Eigen::Vector3d(22.0, 0.0, 0.0)).norm(), 0.5);
  }
  const auto start = across.find_motion(false, false);
  EXPECT_LT(start ? std::abs(start->v_odom.x()) : 0.0, 3.0);
}

/// In a tunnel most points lie on the walls, and some of them at the height of the ground.
TEST(StartReview, FindsTheGroundBetweenWalls) {
  SyntheticRoad road;
  road.acceleration_mps2 = 3.0;
  road.walls_m = 2.5;
  const double tilt = -std::atan2(road.acceleration_mps2, SensorConfig().gravity_mps2);
  StartReview review{Config()};
  for (int k = 0; k < 8; ++k) add_scan(road, k, 15.0, tilt, &review);
  const auto start = review.find_motion(false, false);
  ASSERT_TRUE(start);
  const Eigen::Matrix3d R_odom_road = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EXPECT_GT(start->up_odom.dot(R_odom_road.col(2)), std::cos(0.03));
}

/// An accelerometer that feels 3 m/s^2 backwards takes the road for a slope.
TEST(StartReview, WhoGathersSpeedStandsUprightByTheGround) {
  SyntheticRoad road;
  road.acceleration_mps2 = 3.0;
  const SensorConfig sensor;
  const double tilt = -std::atan2(road.acceleration_mps2, sensor.gravity_mps2);
  StartReview review{Config()};
  for (int k = 0; k < 8; ++k) add_scan(road, k, 15.0, tilt, &review);
  const auto start = review.find_motion(false, false);
  ASSERT_TRUE(start);
  const Eigen::Matrix3d R_odom_road = Eigen::AngleAxisd(tilt, Eigen::Vector3d::UnitY()).toRotationMatrix();
  EXPECT_GT(start->up_odom.dot(R_odom_road.col(2)), std::cos(0.02));
  EXPECT_LT((start->v_odom - 15.0 * R_odom_road.col(0)).norm(), 0.7);
}

TEST(StartReview, WaitsWhileACalmImuMayYetSayThatTheSensorStands) {
  StartReview review{Config()};
  for (int k = 0; k < 8; ++k)
    add_scan(SyntheticRoad(), k, 22.0, 0.0, &review, 0.5 * ImuConfig().static_duration_s);
  EXPECT_FALSE(review.find_motion(false, false));
  EXPECT_FALSE(review.is_over());
  add_scan(SyntheticRoad(), 8, 22.0, 0.0, &review);
  EXPECT_TRUE(review.find_motion(false, false));
}

TEST(StartReview, AsksAboutARestOnlyWhereSurfacesLeaveADirectionOpen) {
  const double calm_s = ImuConfig().static_duration_s;
  for (const bool is_open : {false, true}) {
    StartReview review{Config()};
    for (int k = 0; k < 8; ++k)
      add_scan(SyntheticRoad(), k, 22.0, 0.0, &review, calm_s, {is_open ? 10.0 : 500.0, 1000.0, 1000.0});
    EXPECT_EQ(review.find_motion(false, true).has_value(), is_open);
    EXPECT_TRUE(review.is_over());
  }
}

/// A road's brightness may repeat itself, and a velocity at which it does may win, but hardly by far.
TEST(StartReview, DoesNotOverruleAWitnessAgainstWhatStandsBesideTheRoad) {
  const auto review_of = [](double posts_mps, int scans, double roughness = 0.1) {
    SyntheticRoad road;
    road.with_traffic = false;
    road.roughness = roughness;
    StartReview review{Config()};
    for (int k = 0; k < scans; ++k) {
      add_scan(road, k, 22.0, 0.0, &review, ImuConfig().static_duration_s, Eigen::Vector3d::Zero(),
               posts(posts_mps * SyntheticRoad::kPeriod_s * k));
    }
    return review;
  };
  EXPECT_TRUE(review_of(22.0, 8).find_motion(true, false));
  // What drives along hides speed.
  EXPECT_TRUE(review_of(5.0, 8).find_motion(true, false));
  EXPECT_TRUE(review_of(40.0, 8).find_motion(false, false));
  StartReview contradicted = review_of(40.0, 8);
  EXPECT_FALSE(contradicted.find_motion(true, false));
  EXPECT_FALSE(contradicted.is_over());
  StartReview last = review_of(40.0, 16);
  EXPECT_FALSE(last.find_motion(true, false));
  EXPECT_TRUE(last.is_over());
  EXPECT_TRUE(review_of(40.0, 8, 0.6).find_motion(true, false));
}

/// Where the first two scans told a wrong motion, what follows may hold on to one between it and the truth.
TEST(StartReview, CorrectsAVelocityThatIsWrongByLittle) {
  for (const double taken_mps : {20.0, 22.0}) {
    StartReview review{Config()};
    for (int k = 0; k < 8; ++k) {
      add_scan(SyntheticRoad(), k, 22.0, 0.0, &review, ImuConfig().static_duration_s, Eigen::Vector3d::Zero(),
               {}, taken_mps);
    }
    const auto start = review.find_motion(true, false);
    ASSERT_EQ(start.has_value(), taken_mps < 21.0);
    EXPECT_TRUE(review.is_over());
    if (start) {
      EXPECT_NEAR(start->v_odom.x(), 22.0, 0.5);
    }
  }
}

/// The first scan falls into a jerk: by its readings the ground would be level.
TEST(StartReview, StandsUprightByWhatWasFeltOverAllScans) {
  SyntheticRoad road;
  road.acceleration_mps2 = 2.0;
  StartReview review{Config()};
  for (int k = 0; k < 8; ++k) add_scan(road, k, 15.0, 0.0, &review);
  const auto start = review.find_motion(false, false);
  ASSERT_TRUE(start);
  EXPECT_GT(start->up_odom.z(), std::cos(0.02));
  EXPECT_GT(start->sigma.gravity, 0.4);
  EXPECT_NEAR(start->v_odom.x(), 15.0, 0.5);
}

TEST(StartReview, IsOverWhenTheScansSayNothing) {
  SyntheticRoad road;
  road.roughness = 0.0;
  StartReview review{Config()};
  for (int k = 0; k < 16; ++k) {
    EXPECT_FALSE(review.is_over()) << k;
    add_scan(road, k, 22.0, 0.0, &review);
    EXPECT_FALSE(review.find_motion(false, false)) << k;
  }
  EXPECT_TRUE(review.is_over());
}

}  // namespace
}  // namespace fdi_lio::odometry
