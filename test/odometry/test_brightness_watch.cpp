#include <algorithm>
#include <cmath>

#include "synthetic_road.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/odometry/brightness_watch.hpp"

namespace fdi_lio::odometry {
namespace {

/// Held across the road and upwards, open along it.
Eigen::Matrix3d information_along(double information) {
  return Eigen::Vector3d(information, 1e5, 1e6).asDiagonal();
}

/// An estimate that drives along the road: it takes the acceleration for `error_mps2` more than it is, and
/// does what the watch says. `surfaces` and `textures` say so much of the way along [1/m^2].
class Drive {
 public:
  Drive(double speed_mps, double error_mps2, double surfaces, double textures = 0.0)
      : speed_(speed_mps), error_mps2_(error_mps2) {
    information_.surfaces = information_along(surfaces);
    information_.all = information_along(surfaces + textures);
    state_.v_odom.x() = speed_mps;
    watch_.reset(0.0, 0.0);
  }

  void go_on(int scans) {
    for (int k = 0; k < scans; ++k, ++number_) {
      const double time_s = SyntheticRoad::kPeriod_s * number_;
      const FeatureSet features = road_.scan(time_s, speed_, 0.0, static_cast<unsigned>(number_));
      state_.stamp = features.stamp;
      const auto correction = watch_.add(features, Eigen::Vector3d::Zero(), state_, information_);
      if (correction) {
        ++corrections_;
        state_.v_odom += correction->velocity;
        error_mps2_ += correction->acceleration.x();
        across_ = std::max(across_, correction->velocity.tail<2>().norm());
      }
      error_m_ += SyntheticRoad::kPeriod_s * (state_.v_odom.x() - speed_);
      state_.t_odom_imu += SyntheticRoad::kPeriod_s * state_.v_odom;
      state_.v_odom.x() += SyntheticRoad::kPeriod_s * error_mps2_;
    }
  }

  int corrections() const { return corrections_; }
  double error_mps() const { return state_.v_odom.x() - speed_; }
  double error_mps2() const { return error_mps2_; }
  double across_mps() const { return across_; }
  double error_m() const { return error_m_; }
  double stated_m() const { return std::sqrt(watch_.position_covariance()(0, 0)); }
  double stated_mps() const { return std::sqrt(watch_.velocity_covariance()(0, 0)); }

  BrightnessWatch watch_ = BrightnessWatch(Eigen::Isometry3d::Identity());
  SyntheticRoad road_;
  imu::NavState state_;

 private:
  double speed_;
  double error_mps2_;
  TrustedInformation information_;
  int number_ = 0;
  int corrections_ = 0;
  double across_ = 0.0;
  double error_m_ = 0.0;
};

/// By itself the velocity would be off by 4 m/s in the end.
TEST(BrightnessWatch, HoldsAVelocityThatNothingElseHolds) {
  Drive drive(20.0, 0.1, 0.0);
  drive.go_on(100);
  for (int part = 0; part < 10; ++part) {
    drive.go_on(30);
    EXPECT_LT(std::abs(drive.error_mps()), 0.4) << "after " << 10 + 3 * (part + 1) << " s";
    EXPECT_LT(std::abs(drive.error_mps()), 3.0 * drive.stated_mps());
    EXPECT_LT(std::abs(drive.error_m()), 3.0 * drive.stated_m());
  }
  EXPECT_LT(drive.stated_mps(), 0.5);
  EXPECT_LT(drive.stated_m(), 20.0);  // of 800 m; with the acceleration for itself 80 m
  EXPECT_LT(std::abs(drive.error_mps2()), 0.06);
  EXPECT_LT(drive.across_mps(), 1e-9);
}

/// Where little is painted a doubtful velocity is corrected by parts, but at once when it is off by more than
/// was thought possible.
TEST(BrightnessWatch, BelievesThatItWasWrong) {
  for (const double error : {0.15, 2.0}) {
    Drive drive(20.0, 0.0, 0.0);
    drive.road_.roughness = 0.08;
    drive.state_.v_odom.x() += error;
    while (drive.corrections() == 0) drive.go_on(1);
    const double left = std::abs(drive.error_mps()) / error;
    const bool is_corrected = left < 0.15;
    const bool is_large = error > 1.0;
    EXPECT_EQ(is_corrected, is_large) << left;
    EXPECT_LT(std::abs(drive.error_m()), 2.0 * drive.stated_m());
  }
}

TEST(BrightnessWatch, LeavesAloneWhatSurfacesHold) {
  Drive drive(20.0, 0.0, 1000.0);
  drive.go_on(100);
  EXPECT_EQ(drive.corrections(), 0);
  EXPECT_LT(drive.stated_mps(), 0.05);
  EXPECT_LT(drive.stated_m(), 0.1);
}

/// A map that was made with a wrong velocity confirms it, and what the IMU says drives it further off.
TEST(BrightnessWatch, RefutesWhatTexturesConfirm) {
  Drive drive(20.0, 0.3, 0.0, 1000.0);
  drive.state_.v_odom.x() -= 2.0;
  EXPECT_LT(drive.stated_mps(), 0.1);
  drive.go_on(50);
  for (int part = 0; part < 5; ++part) {
    drive.go_on(50);
    EXPECT_LT(std::abs(drive.error_mps()), 0.8) << "after " << 5 * (part + 2) << " s";
  }
}

/// Beams that are off feign some hundredths of a metre per second; two answers in a row are needed.
TEST(BrightnessWatch, RefutesWhatSurfacesHardlyHold) {
  Drive drive(20.0, 0.3, 1000.0);
  drive.state_.v_odom.x() -= 2.0;
  drive.go_on(31);
  EXPECT_LT(drive.stated_mps(), 0.1);
  EXPECT_EQ(drive.corrections(), 0);
  drive.go_on(1);
  EXPECT_EQ(drive.corrections(), 1);
  drive.go_on(20);
  for (int part = 0; part < 5; ++part) {
    drive.go_on(50);
    EXPECT_LT(std::abs(drive.error_mps()), 0.8) << "after " << 5 * (part + 2) << " s";
  }
}

TEST(BrightnessWatch, BelievesSurfacesThatHoldWell) {
  Drive drive(20.0, 0.0, 1e5);
  drive.state_.v_odom.x() -= 2.0;
  drive.go_on(100);
  EXPECT_EQ(drive.corrections(), 0);
}

TEST(BrightnessWatch, LeavesAloneWhatTexturesHold) {
  Drive drive(20.0, 0.0, 0.0, 1000.0);
  drive.go_on(200);
  EXPECT_EQ(drive.corrections(), 0);
  EXPECT_LT(drive.stated_mps(), 0.05);
}

/// Unless something holds it: the variances of the integrals of v, a and the walk of a.
TEST(BrightnessWatch, StatesWhatVelocityAndPositionMayBeOffBy) {
  Drive drive(5.0, 0.0, 0.0);
  drive.go_on(31);
  const double T = 3.0;
  const double velocity = 0.05 * 0.05 + 0.1 * 0.1 * T * T + 0.03 * 0.03 * T * T * T / 3.0;
  const double position =
      0.05 * 0.05 * T * T + 0.1 * 0.1 * std::pow(T, 4) / 4.0 + 0.03 * 0.03 * std::pow(T, 5) / 20.0;
  EXPECT_NEAR(drive.stated_mps(), std::sqrt(velocity), 0.05 * std::sqrt(velocity));
  EXPECT_NEAR(drive.stated_m(), std::sqrt(position), 0.05 * std::sqrt(position));
  EXPECT_NEAR(drive.watch_.position_covariance()(1, 1), 0.0, 1e-12);
}

/// What travels with the sensor would speak for rest.
TEST(BrightnessWatch, LeavesASlowSensorAlone) {
  Drive drive(5.0, 0.0, 0.0);
  drive.go_on(60);
  EXPECT_EQ(drive.corrections(), 0);
}

/// After 16 scans a velocity that nothing holds is doubtful, and corrected.
TEST(BrightnessWatch, BeginsAnew) {
  Drive drive(20.0, 0.0, 0.0);
  drive.go_on(15);
  EXPECT_EQ(drive.corrections(), 0);
  drive.watch_.reset(0.0, 0.0);
  drive.go_on(15);
  EXPECT_EQ(drive.corrections(), 0);
  drive.go_on(1);
  EXPECT_EQ(drive.corrections(), 1);
  drive.watch_.reset(0.3, 0.15);
  drive.go_on(16);
  EXPECT_EQ(drive.corrections(), 2);
}

}  // namespace
}  // namespace fdi_lio::odometry
