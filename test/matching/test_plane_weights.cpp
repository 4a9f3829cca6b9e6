#include <algorithm>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/matching/plane_weights.hpp"

namespace fdi_lio::matching {
namespace {

/// Planes of a place as a scan has them: a floor, and walls across x and y in all directions around.
class Place : public testing::Test {
 protected:
  void SetUp() override {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> along(-20.0, 20.0);
    std::uniform_real_distribution<double> height(0.0, 4.0);
    for (int k = 0; k < 3000; ++k) {
      add({along(random), along(random), -1.5}, Eigen::Vector3d::UnitZ());
      if (k % 2 == 0)
        add({k % 4 == 0 ? 20.0 : -20.0, along(random), height(random)}, Eigen::Vector3d::UnitX());
      if (k % 2 == 1)
        add({along(random), k % 4 == 1 ? 20.0 : -20.0, height(random)}, Eigen::Vector3d::UnitY());
    }
    input_.covariance = 1e-6 * Matrix6d::Identity();
    input_.point_variance = 0.02 * 0.02;
    input_.correlation_factor = 4.0;
  }

  /// Seen where it is, or as far off as a pose that is wrong by `error` ([dtheta, dt]) makes it look.
  PlaneMatches seen(const Vector6d& error) const {
    PlaneMatches matches = matches_;
    for (auto& match : matches) match->residual_m = match->jacobian.dot(error);
    return matches;
  }

  std::vector<bool> far_walls_across_x() const {
    std::vector<bool> are(planes_.size());
    for (std::size_t i = 0; i < planes_.size(); ++i)
      are[i] = matches_[i]->normal.x() > 0.5 && planes_[i].x() > 0.0;
    return are;
  }

  static double mean(const std::vector<float>& trust, const std::vector<bool>& of, bool is) {
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < trust.size(); ++i) {
      if (of[i] != is) continue;
      sum += static_cast<double>(trust[i]);
      count += 1.0;
    }
    return sum / count;
  }

  std::vector<Eigen::Vector3d> planes_;
  PlaneMatches matches_;
  TrustInput input_;

 private:
  void add(const Eigen::Vector3d& p, const Eigen::Vector3d& normal) {
    planes_.push_back(p);
    PlaneMatch match;
    match.normal = normal;
    match.variance = 0.02 * 0.02;
    match.jacobian << p.cross(normal), normal;
    matches_.emplace_back(match);
  }
};

TEST_F(Place, WhatAgreesWithThePredictionIsTrusted) {
  const auto trust = trust_planes(planes_, seen(Vector6d::Zero()), input_);
  EXPECT_EQ(*std::min_element(trust.begin(), trust.end()), 1.0F);
}

TEST_F(Place, AllWallsTogetherRefuteAPredictionThatIsSureOfItself) {
  Vector6d shift = Vector6d::Zero();
  shift[3] = 0.1;
  Vector6d turn = Vector6d::Zero();
  turn[2] = 0.03;
  Vector6d both;
  both << 0.004, -0.002, 0.02, -0.05, 0.15, 0.03;
  for (const Vector6d& error : {shift, turn, both}) {
    const auto trust = trust_planes(planes_, seen(error), input_);
    EXPECT_GT(*std::min_element(trust.begin(), trust.end()), 0.9F) << error.transpose();
  }
}

TEST_F(Place, AFewWallsThatMoveRefuteNothing) {
  // An eighth of the planes, all of what is across x on one side: a lorry that drives along.
  PlaneMatches matches = seen(Vector6d::Zero());
  const std::vector<bool> moves = far_walls_across_x();
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    if (moves[i]) matches[i]->residual_m = 0.1;
  }
  const auto trust = trust_planes(planes_, matches, input_);
  EXPECT_LT(mean(trust, moves, true), 0.05);
  EXPECT_GT(mean(trust, moves, false), 0.99);
}

TEST_F(Place, WallsThatRefuteAPredictionStillCondemnWhatMoves) {
  Vector6d error = Vector6d::Zero();
  error[4] = 0.3;
  PlaneMatches matches = seen(error);
  std::vector<bool> moves(planes_.size());
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    moves[i] = matches[i]->normal.y() > 0.5 && planes_[i].y() > 0.0 && planes_[i].x() > 4.0;
    if (moves[i]) matches[i]->residual_m -= 0.4;
  }
  const auto trust = trust_planes(planes_, matches, input_);
  EXPECT_LT(mean(trust, moves, true), 0.1);
  EXPECT_GT(mean(trust, moves, false), 0.95);
}

TEST_F(Place, ManyThatMoveRefuteNothingWhileOthersHoldTheSameDirection) {
  // Two fifths of the planes move, as beside a train; the others hold the same directions.
  PlaneMatches matches = seen(Vector6d::Zero());
  std::vector<bool> moves(planes_.size(), false);
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    moves[i] = planes_[i].y() > 4.0;
    if (moves[i]) matches[i]->residual_m = matches[i]->normal.dot(Eigen::Vector3d(0.15, 0.1, 0.1));
  }
  const auto trust = trust_planes(planes_, matches, input_);
  EXPECT_LT(mean(trust, moves, true), 0.1);
  EXPECT_GT(mean(trust, moves, false), 0.95);
}

TEST_F(Place, DirectionsThatNothingTellsStayAsPredicted) {
  // Without walls across x nothing tells of x. Nor is divided by what a prediction without doubt leaves.
  Vector6d error = Vector6d::Zero();
  error[4] = 0.1;
  PlaneMatches matches = seen(error);
  for (std::size_t i = 0; i < planes_.size(); ++i) {
    if (matches[i]->normal.x() > 0.5) matches[i].reset();
  }
  const auto trust = trust_planes(planes_, matches, input_);
  EXPECT_GT(*std::min_element(trust.begin(), trust.end()), 0.9F);
  input_.covariance.setZero();
  for (const float each : trust_planes(planes_, matches, input_)) EXPECT_TRUE(each >= 0.0F && each <= 1.0F);
}

}  // namespace
}  // namespace fdi_lio::matching
