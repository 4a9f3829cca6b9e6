#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/scan/data_check.hpp"
#include "fdi_lio/scan/ground_plane.hpp"

namespace fdi_lio::scan {
namespace {

using testing::HasSubstr;

constexpr Stamp kStart = 1700000000000000000;
constexpr double kDegree = M_PI / 180.0;

/// What the sensors of a vehicle that stands on flat ground between two walls record; a test changes it.
struct Recording {
  double duration_s = 3.0;
  double imu_rate_hz = 200.0;
  double imu_start_s = 0.0;
  double imu_clock_s = 0.0;  ///< how far the IMU's clock is ahead
  double scan_interval_s = 0.1;
  double sweep_s = 0.1;
  int rings = 16;
  Eigen::Quaterniond q_lidar_imu = Eigen::Quaterniond::Identity();  ///< as it really is
  std::function<void(double t, imu::ImuSample*)> change_imu = [](double, imu::ImuSample*) {};
  std::function<void(Scan*)> change_scan = [](Scan*) {};
};

class Check : public testing::Test {
 protected:
  Check() { config_.sensor.ring_count = 16; }

  Scan make_scan(double end_s) {
    Scan scan;
    scan.stamp = add_seconds(kStart, end_s);
    scan.duration_s = recording_.sweep_s;
    scan.has_time = true;
    std::uniform_real_distribution<float> along(-10.0F, 10.0F);
    std::normal_distribution<float> noise(0.0F, 0.02F);
    for (int i = 0; i < 4000; ++i) {
      Point point;
      point.position = {along(random_), 0.5F * along(random_), -1.5F + noise(random_)};
      if (i % 3 == 1) point.position = {along(random_), 5.0F + noise(random_), 0.2F * along(random_) + 0.5F};
      if (i % 3 == 2) point.position = {along(random_), -5.0F + noise(random_), 0.2F * along(random_) + 0.5F};
      point.ring = static_cast<std::uint16_t>(i % recording_.rings);
      scan.points.push_back(point);
    }
    return scan;
  }

  /// Findings about `recording_` under `config_`.
  std::vector<Finding> run() {
    DataCheck check(config_);
    const Recording& r = recording_;
    std::normal_distribution<double> noise(0.0, 0.02);
    double scan_end_s = r.sweep_s;
    const auto add_scans_until = [&](double t) {
      for (; scan_end_s <= t + 1e-6; scan_end_s += r.scan_interval_s) {
        Scan scan = make_scan(scan_end_s);
        r.change_scan(&scan);
        check.add_scan(scan);
      }
    };
    for (int i = 0; i < r.imu_rate_hz * (r.duration_s - r.imu_start_s); ++i) {
      const double t = r.imu_start_s + i / r.imu_rate_hz;
      add_scans_until(t);
      imu::ImuSample sample;
      sample.stamp = add_seconds(kStart, t + r.imu_clock_s);
      sample.acceleration = r.q_lidar_imu.conjugate() * Eigen::Vector3d(0.0, 0.0, 9.81);
      for (int axis = 0; axis < 3; ++axis) {
        sample.acceleration[axis] += noise(random_);
        sample.angular_velocity[axis] = 0.1 * noise(random_);
      }
      r.change_imu(t, &sample);
      check.add_imu(sample);
    }
    add_scans_until(r.duration_s);
    return check.findings();
  }

  /// Expects exactly one finding.
  void expect_only(Severity severity, const std::string& key, const std::vector<std::string>& parts) {
    const std::vector<Finding> findings = run();
    std::string all;
    for (const Finding& finding : findings) all += finding.text + "\n";
    ASSERT_EQ(findings.size(), 1U) << all;
    EXPECT_EQ(findings.front().key, key);
    EXPECT_EQ(findings.front().severity, severity) << all;
    for (const std::string& part : parts) EXPECT_THAT(findings.front().text, HasSubstr(part));
  }

  Config config_;
  Recording recording_;
  std::mt19937 random_{7};
};

TEST_F(Check, GoodDataGivesNoFinding) { EXPECT_TRUE(run().empty()); }

// --- acceleration ---

TEST_F(Check, AccelerationInGIsAnErrorThatNamesTheParameter) {
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->acceleration /= 9.80665; };
  expect_only(Severity::kError, "imu_unit",
              {"is 1.00 ", "9.81 is expected", "set sensor.acceleration_unit to g"});
  config_.sensor.acceleration_unit = "g";
  EXPECT_TRUE(run().empty());
  config_.sensor.acceleration_unit = "auto";
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, AccelerationThatIsNotInGThoughSaidToBe) {
  config_.sensor.acceleration_unit = "g";
  expect_only(Severity::kError, "imu_unit", {"is 9.81 ", "96.2", "set sensor.acceleration_unit to m/s^2"});
}

TEST_F(Check, AccelerationInOtherUnitsIsAnError) {
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->acceleration *= 1000.0 / 9.81; };
  expect_only(Severity::kError, "imu_unit", {"milli-g"});
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->acceleration *= 40.0; };
  expect_only(Severity::kError, "imu_unit", {"no known unit"});
}

TEST_F(Check, GlitchesAreAWarningAndDoNotSpoilTheOtherChecks) {
  recording_.change_imu = [n = 0](double, imu::ImuSample* sample) mutable {
    if (++n % 100 == 50) sample->acceleration.x() = 1e6;
    if (n % 100 == 70) sample->angular_velocity.x() = 4000.0;
  };
  expect_only(Severity::kWarning, "imu_limit",
              {"12 of 600", "1000000.0", "4000.0", "sensor.max_acceleration"});
}

TEST_F(Check, AGyroBeyondEverySensorIsTheWrongUnit) {
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->angular_velocity.z() = 150.0; };
  expect_only(Severity::kError, "gyro_unit", {"150.0", "deg/s"});
}

TEST_F(Check, AccelerationThatIsALittleOffIsAWarning) {
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->acceleration.z() += 1.5; };
  expect_only(Severity::kWarning, "gravity", {"11.31", "check.gravity_tolerance"});
  config_.check.gravity_tolerance_mps2 = 2.0;
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, VibrationIsNoFinding) {
  recording_.change_imu = [](double t, imu::ImuSample* sample) {
    sample->acceleration += 6.0 * std::sin(2.0 * M_PI * 33.0 * t) * Eigen::Vector3d(1.0, 0.5, 1.0);
  };
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, AJoltIsNoFinding) {
  recording_.change_imu = [](double t, imu::ImuSample* sample) {
    if (t < 0.2) sample->acceleration.x() += 150.0;
  };
  EXPECT_TRUE(run().empty());
}

// --- gyro ---

/// Rolling to and fro by 0.4 rad; accelerometer and gyro (in units of `unit` rad/s) agree.
void roll(double t, double unit, imu::ImuSample* sample) {
  const double angle = 0.4 * std::sin(2.0 * t);
  sample->acceleration = so3::exp_q(Eigen::Vector3d(-angle, 0.0, 0.0)) * sample->acceleration;
  sample->angular_velocity.x() += 0.8 * std::cos(2.0 * t);
  sample->angular_velocity /= unit;
}

TEST_F(Check, RollingIsNoFinding) {
  recording_.change_imu = [](double t, imu::ImuSample* sample) { roll(t, 1.0, sample); };
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, GyroInDegreesIsAnErrorWhenItTurnsGravityAbout) {
  recording_.change_imu = [](double t, imu::ImuSample* sample) { roll(t, kDegree, sample); };
  expect_only(Severity::kError, "gyro_unit", {"deg/s", "let the IMU's driver send rad/s"});
}

TEST_F(Check, GyroInDegreesIsAnErrorWhenNothingTurnsSoFast) {
  // Turning on the spot does not move gravity.
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->angular_velocity.z() += 20.0; };
  expect_only(Severity::kError, "gyro_unit", {"20.0", "check.max_angular_rate"});
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->angular_velocity.z() += 1.5; };
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, AMultirotorThatTiltsIsAWarningAtMost) {
  // It never feels its tilt: the accelerometer points along the thrust.
  recording_.change_imu = [](double t, imu::ImuSample* sample) {
    sample->angular_velocity.x() += 0.4 * 2.0 * std::cos(2.0 * t);
  };
  for (const Finding& finding : run()) EXPECT_NE(finding.severity, Severity::kError) << finding.text;
}

// --- rates and clocks ---

TEST_F(Check, ImuRateOutsideTheLimitsIsAWarning) {
  recording_.imu_rate_hz = 20.0;
  expect_only(Severity::kWarning, "imu_rate", {"20.0 Hz", "50 to 500"});
  recording_.imu_rate_hz = 1000.0;
  expect_only(Severity::kWarning, "imu_rate", {"1000.0 Hz"});
}

TEST_F(Check, AnotherScanPeriodIsAWarningWithTheRightValue) {
  recording_.scan_interval_s = recording_.sweep_s = 0.05;
  expect_only(Severity::kWarning, "scan_period", {"every 0.0500 s", "set sensor.scan_period to 0.050"});
}

TEST_F(Check, MissingScansAreToldFromAnotherPeriod) {
  recording_.scan_interval_s = 0.2;
  expect_only(Severity::kWarning, "scan_period", {"every 0.2000 s", "each sweeps 0.1000 s", "missing"});
}

TEST_F(Check, ClocksWithoutCommonTimeAreAnErrorThatNamesTheOffset) {
  recording_.imu_clock_s = 12.5;
  expect_only(Severity::kError, "clocks",
              {"no time in common", "IMU is 12.49 s ahead", "sensor.lidar_time_offset"});
  recording_.imu_clock_s = -12.5;
  expect_only(Severity::kError, "clocks", {"IMU is -12.51 s ahead"});
}

TEST_F(Check, AnImuThatCoversAPartOfTheScansIsAWarning) {
  recording_.imu_clock_s = 1.5;
  expect_only(Severity::kWarning, "clocks", {"covers only 5", "sensor.lidar_time_offset"});
  recording_.imu_clock_s = 0.0;
  recording_.imu_start_s = 1.5;
  expect_only(Severity::kWarning, "clocks", {"covers only 5"});
}

// --- what is missing ---

TEST_F(Check, WithoutImuTheTopicIsNamed) {
  recording_.imu_start_s = recording_.duration_s;
  config_.sensor.imu_topic = "/some/imu";
  expect_only(Severity::kWarning, "no_imu", {"/some/imu", "sensor.imu_topic"});
  config_.sensor.imu_topic = "";
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, WithoutScansTheTopicIsNamed) {
  DataCheck check(config_);
  const std::vector<Finding> findings = check.findings();
  ASSERT_FALSE(findings.empty());
  EXPECT_THAT(findings.front().text, HasSubstr("/points_raw"));
}

TEST_F(Check, BadReadingsAreCounted) {
  int i = 0;
  recording_.change_imu = [&i](double, imu::ImuSample* sample) {
    if (++i % 100 == 0) sample->acceleration.x() = std::numeric_limits<double>::quiet_NaN();
  };
  expect_only(Severity::kWarning, "imu_non_finite", {"6 of 600 IMU readings"});
  i = 0;
  recording_.change_imu = [&i](double, imu::ImuSample* sample) {
    if (++i % 200 == 0) sample->stamp -= 20000000;
  };
  expect_only(Severity::kWarning, "imu_order", {"3 of 600 IMU readings", "out of order"});
}

TEST_F(Check, ScansOutOfOrderAreCounted) {
  int i = 0;
  recording_.change_scan = [&i](Scan* scan) {
    if (++i % 10 == 0) scan->stamp = add_seconds(scan->stamp, -0.1);
  };
  expect_only(Severity::kWarning, "scan_order", {"3 scans", "/points_raw"});
}

TEST_F(Check, OneStampFarAwayDoesNotHideTheCommonTime) {
  for (const double jump_s : {3600.0, -3600.0}) {
    int i = 0;
    recording_.change_imu = [&i, jump_s](double, imu::ImuSample* sample) {
      if (++i == 300) sample->stamp = add_seconds(sample->stamp, jump_s);
    };
    expect_only(Severity::kWarning, "imu_order", {"1 of 600 IMU readings", "far from the others"});
  }
}

TEST_F(Check, WhatComesAfterAJumpIsNotCompared) {
  const Stamp jump = to_nanoseconds(3600.0);
  const auto expect_jump = [this] {
    for (const Finding& finding : run())
      EXPECT_THAT(finding.key, testing::AnyOf("jump", "imu_order", "scan_order")) << finding.text;
  };
  recording_.change_imu = [=](double t, imu::ImuSample* sample) { sample->stamp += t > 1.5 ? jump : 0; };
  expect_jump();
  recording_.change_scan = [=](Scan* scan) { scan->stamp += scan->stamp > kStart + 1500000000 ? jump : 0; };
  expect_jump();
}

TEST_F(Check, PointTimesThatAreMissingAreAWarning) {
  recording_.change_scan = [](Scan* scan) { scan->time_from_azimuth = true; };
  expect_only(Severity::kWarning, "point_time", {"azimuth", "sensor.deskew"});
  recording_.change_scan = [](Scan* scan) { scan->has_time = false; };
  expect_only(Severity::kWarning, "point_time", {"same time"});
  config_.sensor.deskew = "already_done";
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, AnotherRingCountIsAWarning) {
  recording_.rings = 32;
  expect_only(Severity::kWarning, "rings", {"32 rings", "sensor.ring_count is 16"});
  recording_.rings = 16;
  config_.sensor.ring_count = 64;
  expect_only(Severity::kWarning, "rings", {"16 rings", "sensor.ring_count is 64"});
  // Beams that look at the sky are no finding.
  config_.sensor.ring_count = 32;
  EXPECT_TRUE(run().empty());
}

// --- extrinsic ---

TEST_F(Check, ARightExtrinsicIsNoFindingHoweverTheImuIsMounted) {
  for (const Eigen::Vector3d& turn : {Eigen::Vector3d(M_PI, 0.0, 0.0), Eigen::Vector3d(0.0, -M_PI / 2, 0.0),
                                      Eigen::Vector3d(0.7, 0.4, -2.0)}) {
    recording_.q_lidar_imu = so3::exp_q(turn);
    config_.sensor.q_imu_lidar = recording_.q_lidar_imu.conjugate();
    EXPECT_TRUE(run().empty());
  }
}

TEST_F(Check, ATiltedExtrinsicIsAWarningWithTheAngle) {
  config_.sensor.q_imu_lidar = so3::exp_q(Eigen::Vector3d(30.0 * kDegree, 0.0, 0.0));
  expect_only(Severity::kWarning, "extrinsic", {"tilted by 30 deg", "sensor.T_imu_lidar.rotation"});
  config_.sensor.q_imu_lidar = so3::exp_q(Eigen::Vector3d(M_PI / 2, 0.0, 0.0));
  expect_only(Severity::kWarning, "extrinsic", {"tilted by 90 deg"});
  config_.sensor.q_imu_lidar = so3::exp_q(Eigen::Vector3d(10.0 * kDegree, 0.0, 0.0));
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, AnUpsideDownExtrinsicIsAWarning) {
  config_.sensor.q_imu_lidar = so3::exp_q(Eigen::Vector3d(0.0, M_PI, 0.0));
  expect_only(Severity::kWarning, "extrinsic", {"upside down"});
}

TEST_F(Check, InMotionTheExtrinsicIsNotJudged) {
  config_.sensor.q_imu_lidar = so3::exp_q(Eigen::Vector3d(30.0 * kDegree, 0.0, 0.0));
  recording_.change_imu = [](double t, imu::ImuSample* sample) {
    sample->acceleration.x() += std::sin(6.0 * t);
  };
  EXPECT_TRUE(run().empty());
}

TEST_F(Check, ErrorsComeFirst) {
  recording_.imu_rate_hz = 20.0;
  recording_.change_imu = [](double, imu::ImuSample* sample) { sample->acceleration /= 9.80665; };
  const std::vector<Finding> findings = run();
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].key, "imu_unit");
  EXPECT_EQ(findings[1].key, "imu_rate");
}

// --- the plane ---

TEST(FindPlane, FindsTheOneAlongTheAxisAndItsSide) {
  std::vector<Eigen::Vector3f> points;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> along(-10.0F, 10.0F);
  const Eigen::Vector3f normal = Eigen::Vector3f(0.1F, -0.2F, 1.0F).normalized();
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3f p(along(random), along(random), along(random));
    points.push_back(i % 4 == 0 ? p : Eigen::Vector3f(p - (normal.dot(p) + 2.0F) * normal));
  }
  const Plane below = find_plane(points, Eigen::Vector3d::UnitZ(), 30.0 * kDegree);
  EXPECT_NEAR(below.share, 0.75, 0.02);
  EXPECT_NEAR(below.distance_m, 2.0, 0.05);
  std::size_t under = 0;
  for (const Eigen::Vector3f& p : points) under += normal.dot(p) < -2.3F ? 1 : 0;
  EXPECT_NEAR(below.below, static_cast<double>(under) / 1000.0, 0.01);
  EXPECT_GT(below.normal.dot(normal.cast<double>()), std::cos(1.0 * kDegree));
  EXPECT_LT(find_plane(points, -Eigen::Vector3d::UnitZ(), 30.0 * kDegree).share, 0.1);
  EXPECT_LT(find_plane(points, Eigen::Vector3d::UnitX(), 30.0 * kDegree).share, 0.1);
  EXPECT_EQ(find_plane({}, Eigen::Vector3d::UnitZ(), 1.0).share, 0.0);
}

}  // namespace
}  // namespace fdi_lio::scan
