#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <GeographicLib/LocalCartesian.hpp>
#include <gtest/gtest.h>

#include "fdi_lio/mapping/gnss_aligner.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr double kNoiseM = 1.0;

/// A drive along a bend, seen by a receiver; the map is turned against ENU.
class Receiver {
 public:
  Receiver() {
    truth_.yaw_rad = 2.2;
    truth_.t_enu_map = Eigen::Vector3d(30.0, -10.0, 5.0);
  }

  TiedFix tied(int k) const {
    TiedFix tied;
    tied.node = static_cast<std::size_t>(k);
    tied.path_m = 5.0 * k;
    tied.p_map = Eigen::Vector3d(100.0 * std::sin(0.05 * k), 100.0 - 100.0 * std::cos(0.05 * k), 0.0);
    return tied;
  }

  GnssFix fix(int k, const Eigen::Vector3d& error_m = Eigen::Vector3d::Zero()) {
    std::normal_distribution<double> noise(0.0, kNoiseM);
    const Eigen::Vector3d random(noise(random_), noise(random_), 2.0 * noise(random_));
    const Eigen::Vector3d p = truth_.T_enu_map() * tied(k).p_map + error_m + random;
    GnssFix fix;
    fix.status = 0;
    fix.has_covariance = true;
    fix.covariance = kNoiseM * kNoiseM * Eigen::Matrix3d::Identity();
    local_.Reverse(p.x(), p.y(), p.z(), fix.latitude_deg, fix.longitude_deg, fix.altitude_m);
    return fix;
  }

 private:
  GeographicLib::LocalCartesian local_{48.0, 11.0, 500.0};
  EnuAlignment truth_;
  std::mt19937 random_{3};
};

class GnssAlignment : public testing::Test {
 protected:
  /// Gives fixes until the map is aligned; every fifth is 30 m off.
  void align() {
    for (int k = 0; k < 60 && !alignment_; ++k) {
      const Eigen::Vector3d error(k % 5 == 3 ? 30.0 : 0.0, 0.0, 0.0);
      PositionFix position;
      aligner_.add(receiver_.fix(k, error), receiver_.tied(k), alignment_, &position);
      alignment_ = aligner_.try_align(&positions_);
      last_ = k;
    }
  }

  GnssVerdict judge(const GnssFix& fix, int k) {
    PositionFix position;
    return aligner_.add(fix, receiver_.tied(k), alignment_, &position);
  }

  Receiver receiver_;
  GnssAligner aligner_{GnssConfig(), 0.01};
  std::optional<EnuAlignment> alignment_;
  std::vector<PositionFix> positions_;
  int last_ = 0;
};

TEST_F(GnssAlignment, HeadingIsFoundInSpiteOfOutliers) {
  align();
  ASSERT_TRUE(alignment_);
  EXPECT_NEAR(std::remainder(alignment_->yaw_rad - 2.2, 2.0 * M_PI), 0.0, 0.03);
  for (const PositionFix& position : positions_) EXPECT_NE(position.node % 5, 3U);
  EXPECT_GT(positions_.size(), 10U);
}

TEST_F(GnssAlignment, StandingStillGivesNoHeading) {
  for (int k = 0; k < 60; ++k) {
    PositionFix position;
    EXPECT_EQ(aligner_.add(receiver_.fix(0), receiver_.tied(0), std::nullopt, &position),
              GnssVerdict::kWaiting);
    EXPECT_FALSE(aligner_.try_align(&positions_));
  }
}

TEST_F(GnssAlignment, FixesAreRejectedWithTheReason) {
  align();
  ASSERT_TRUE(alignment_);
  const int k = last_ + 1;
  EXPECT_EQ(judge(receiver_.fix(k), k), GnssVerdict::kAccepted);
  EXPECT_EQ(judge(receiver_.fix(k, Eigen::Vector3d(0.0, 30.0, 0.0)), k), GnssVerdict::kOutlier);
  GnssFix fix = receiver_.fix(k);
  fix.status = -1;
  EXPECT_EQ(judge(fix, k), GnssVerdict::kNoFix);
  fix = receiver_.fix(k);
  fix.latitude_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(judge(fix, k), GnssVerdict::kNoFix);
  fix = receiver_.fix(k);
  fix.covariance *= 1e4;
  EXPECT_EQ(judge(fix, k), GnssVerdict::kPoorCovariance);
}

TEST_F(GnssAlignment, AfterAnOutageTheDriftIsAllowedFor) {
  align();
  ASSERT_TRUE(alignment_);
  const Eigen::Vector3d drift(0.0, 8.0, 0.0);
  const int soon = last_ + 1;
  EXPECT_EQ(judge(receiver_.fix(soon, drift), soon), GnssVerdict::kOutlier);
  const int late = last_ + 120;
  EXPECT_EQ(judge(receiver_.fix(late, drift), late), GnssVerdict::kAccepted);
}

TEST_F(GnssAlignment, AltitudeIsOptional) {
  PositionFix position;
  aligner_.add(receiver_.fix(0), receiver_.tied(0), std::nullopt, &position);
  EXPECT_EQ(position.information(2, 2), 0.0);
  GnssConfig config;
  config.use_altitude = true;
  GnssAligner with_altitude(config, 0.01);
  with_altitude.add(receiver_.fix(0), receiver_.tied(0), std::nullopt, &position);
  EXPECT_GT(position.information(2, 2), 0.0);
}

}  // namespace
}  // namespace fdi_lio::mapping
