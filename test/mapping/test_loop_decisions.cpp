#include <algorithm>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/mapping/loop_decisions.hpp"

namespace fdi_lio::mapping {
namespace {

constexpr double kDriftShare = 0.01;
constexpr std::size_t kTurn = 150;  ///< the keyframe at the far end

/// Out along x and back, a keyframe each metre; the odometry goes off to the side by `drift` for each metre.
class LoopDecisionsTest : public testing::Test {
 protected:
  void drive(std::size_t keyframes, double drift) {
    for (std::size_t n = 0; n < keyframes; ++n) {
      const std::size_t k = frames_.size();
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      const double out_m = 1.0 * static_cast<double>(std::min(k, 2 * kTurn - k));
      T.translation() = Eigen::Vector3d(out_m, drift * static_cast<double>(k), 0.0);
      frames_.push_back({static_cast<Stamp>(k), T, static_cast<double>(k), k == 0});
      chain_.push_back(T);
      graph_.add_node(T);
      if (k == 0) continue;
      RelativePose step;
      step.from = k - 1;
      step.to = k;
      step.T_from_to = chain_[k - 1].inverse() * T;
      step.information = isotropic(1e-3, 0.02).inverse();
      graph_.add_odometry(step);
    }
  }

  /// From the keyframe on the way out to the newest one, on the way back at the same place; `aside_m` wrong.
  LoopCandidate candidate(double aside_m = 0.0) const {
    LoopCandidate loop;
    loop.measured.to = frames_.size() - 1;
    loop.measured.from = 2 * kTurn - loop.measured.to;
    loop.measured.T_from_to.translation().y() = aside_m;
    loop.covariance = isotropic(1e-3, 0.05);
    loop.measured.information = loop.covariance.inverse();
    return loop;
  }

  LoopDecisions::Outcome add(LoopCandidate loop) {
    return decisions_.add(std::move(loop), frames_, chain_, &graph_);
  }

  void solve() {
    ASSERT_TRUE(graph_.solve());
    decisions_.solved(frames_, graph_);
  }

  LoopVerdict verdict(std::size_t index) const { return decisions_.loops().at(index).verdict; }

  static LoopConfig config() {
    LoopConfig config;
    config.drift_share = kDriftShare;
    config.confirm_above_m = 2.0;
    return config;
  }

  LoopDecisions decisions_{config()};
  std::vector<OdometryFrame> frames_;
  std::vector<Eigen::Isometry3d> chain_;
  PoseGraph graph_{PoseGraphSettings()};
};

TEST_F(LoopDecisionsTest, PredictionSigmaGrowsWithTheWaySinceTheLastLoop) {
  EXPECT_DOUBLE_EQ(decisions_.drift_m(80.0), 80.0 * kDriftShare);
  decisions_.set_drift(80.0, 0.3);
  EXPECT_NEAR(decisions_.drift_m(80.0), 0.3, 1e-12);
  EXPECT_NEAR(
      decisions_.prediction_sigma(90.0).translation_m - decisions_.prediction_sigma(80.0).translation_m,
      10.0 * kDriftShare, 1e-12);
}

TEST_F(LoopDecisionsTest, TakesALoopAtOnceWhileTheDriftIsSmall) {
  drive(190, 0.0);
  EXPECT_EQ(add(candidate()), LoopDecisions::Outcome::kTaken);
  EXPECT_EQ(verdict(0), LoopVerdict::kAccepted);
  EXPECT_EQ(graph_.loops().size(), 1U);
  EXPECT_DOUBLE_EQ(decisions_.drift_m(189.0), 0.0);
}

TEST_F(LoopDecisionsTest, LeavesWhatTheRegistrationRejectedOrTheDriftDoesNotExplain) {
  drive(190, 0.0);
  LoopCandidate rejected = candidate();
  rejected.verdict = LoopVerdict::kLowOverlap;
  EXPECT_EQ(add(rejected), LoopDecisions::Outcome::kLeft);
  LoopCandidate far = candidate();
  far.chi_square = 1.01 * config().max_chi_square;
  EXPECT_EQ(add(far), LoopDecisions::Outcome::kLeft);
  EXPECT_EQ(verdict(0), LoopVerdict::kLowOverlap);
  EXPECT_EQ(verdict(1), LoopVerdict::kFarFromPrediction);
  EXPECT_TRUE(graph_.loops().empty());
  EXPECT_FALSE(decisions_.is_newest_taken());
}

TEST_F(LoopDecisionsTest, AfterMuchDriftASecondLoopHasToAgree) {
  drive(260, 0.01);  // 2.6 m
  EXPECT_EQ(add(candidate()), LoopDecisions::Outcome::kLeft);
  EXPECT_EQ(verdict(0), LoopVerdict::kPending);
  drive(5, 0.01);
  EXPECT_EQ(add(candidate(3.0)), LoopDecisions::Outcome::kLeft);  // contradicts the first
  EXPECT_EQ(verdict(1), LoopVerdict::kPending);
  EXPECT_EQ(add(candidate()), LoopDecisions::Outcome::kContradicts);
  EXPECT_TRUE(decisions_.has_contradiction());
  EXPECT_TRUE(decisions_.is_newest_taken());
  EXPECT_EQ(decisions_.unsolved(), 2);
  solve();
  EXPECT_EQ(verdict(0), LoopVerdict::kAccepted);
  EXPECT_EQ(verdict(1), LoopVerdict::kPending);
  EXPECT_EQ(verdict(2), LoopVerdict::kAccepted);
  EXPECT_FALSE(decisions_.has_contradiction());
  EXPECT_EQ(decisions_.unsolved(), 0);
  EXPECT_NEAR(graph_.pose(264).translation().y(), graph_.pose(36).translation().y(), 0.1);
}

TEST_F(LoopDecisionsTest, GivesUpALoopThatNoneCameToConfirm) {
  drive(240, 0.0);
  decisions_.set_drift(239.0, 3.0);
  EXPECT_EQ(add(candidate()), LoopDecisions::Outcome::kLeft);
  decisions_.expire(frames_);
  EXPECT_EQ(verdict(0), LoopVerdict::kPending);
  frames_.push_back({1000, frames_.back().T_odom_imu, frames_.back().path_m + 60.5, false});
  decisions_.expire(frames_);
  EXPECT_EQ(verdict(0), LoopVerdict::kUnconfirmed);
}

TEST_F(LoopDecisionsTest, WhatTheGraphDoesNotFollowIsInconsistent) {
  drive(200, 0.0);
  LoopCandidate wrong = candidate(15.0);
  EXPECT_EQ(add(wrong), LoopDecisions::Outcome::kContradicts);
  for (std::size_t k = 1; k < 8; ++k) {
    LoopCandidate right = candidate();
    right.measured.from += k;
    right.measured.to -= k;
    add(right);
  }
  solve();
  EXPECT_EQ(verdict(0), LoopVerdict::kInconsistent);
  for (std::size_t k = 1; k < 8; ++k) EXPECT_EQ(verdict(k), LoopVerdict::kAccepted) << k;
}

}  // namespace
}  // namespace fdi_lio::mapping
