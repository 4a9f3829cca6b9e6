#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/graph_file.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"
#include "fdi_lio/mapping/pose_graph_factors.hpp"

namespace fdi_lio::mapping {
namespace {

Eigen::Isometry3d random_pose(std::mt19937* random, double angle, double distance) {
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto draw = [&] { return Eigen::Vector3d(uniform(*random), uniform(*random), uniform(*random)); };
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3::exp(angle * draw());
  T.translation() = distance * draw();
  return T;
}

Matrix6d random_information(std::mt19937* random) {
  std::normal_distribution<double> normal;
  Matrix6d A;
  for (int k = 0; k < 36; ++k) A(k) = normal(*random);
  return A * A.transpose() + 0.1 * Matrix6d::Identity();
}

/// Largest deviation of the tangent Jacobian of a pose block from central differences along the manifold.
template <int Residuals>
double pose_jacobian_error(const ceres::CostFunction& cost, std::vector<double*> blocks, int index) {
  using RowMajor = Eigen::Matrix<double, Residuals, kPoseSize, Eigen::RowMajor>;
  RowMajor analytic;
  std::vector<double*> jacobians(blocks.size(), nullptr);
  jacobians[index] = analytic.data();
  Eigen::Matrix<double, Residuals, 1> residuals, plus, minus;
  cost.Evaluate(blocks.data(), residuals.data(), jacobians.data());
  constexpr double kStep = 1e-6;
  double worst = analytic.col(6).norm();
  for (int k = 0; k < kPoseTangentSize; ++k) {
    double moved[kPoseSize];
    Vector6d delta = Vector6d::Zero();
    std::vector<double*> with = blocks;
    with[index] = moved;
    delta[k] = kStep;
    PoseManifold().Plus(blocks[index], delta.data(), moved);
    cost.Evaluate(with.data(), plus.data(), nullptr);
    delta[k] = -kStep;
    PoseManifold().Plus(blocks[index], delta.data(), moved);
    cost.Evaluate(with.data(), minus.data(), nullptr);
    worst = std::max(worst, ((plus - minus) / (2.0 * kStep) - analytic.col(k)).norm());
  }
  return worst;
}

TEST(PoseManifold, MinusUndoesPlus) {
  std::mt19937 random(1);
  double x[kPoseSize], y[kPoseSize];
  pose_to_block(random_pose(&random, 2.0, 5.0), x);
  Vector6d delta, back;
  delta << 0.3, -0.2, 0.5, 1.0, -2.0, 3.0;
  PoseManifold().Plus(x, delta.data(), y);
  PoseManifold().Minus(y, x, back.data());
  EXPECT_LT((back - delta).norm(), 1e-12);
}

TEST(RelativePoseCost, JacobiansAreThoseOfTheResidual) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 20; ++trial) {
    RelativePose measured;
    const Eigen::Isometry3d T_from = random_pose(&random, 3.0, 10.0);
    measured.T_from_to = random_pose(&random, 1.0, 5.0);
    measured.information = random_information(&random);
    const Eigen::Isometry3d T_to = T_from * measured.T_from_to * random_pose(&random, 0.7, 1.0);
    double from[kPoseSize], to[kPoseSize];
    pose_to_block(T_from, from);
    pose_to_block(T_to, to);
    const RelativePoseCost cost(measured);
    EXPECT_LT(pose_jacobian_error<6>(cost, {from, to}, 0), 1e-6);
    EXPECT_LT(pose_jacobian_error<6>(cost, {from, to}, 1), 1e-6);
  }
}

TEST(PositionCost, JacobiansAreThoseOfTheResidual) {
  std::mt19937 random(3);
  PositionFix fix;
  fix.p_imu = Eigen::Vector3d(0.3, -0.2, 1.1);
  fix.p_enu = Eigen::Vector3d(10.0, -5.0, 2.0);
  fix.information = Eigen::Vector3d(1.0, 2.0, 0.3).asDiagonal();
  double pose[kPoseSize];
  pose_to_block(random_pose(&random, 2.0, 20.0), pose);
  double alignment[kAlignmentSize] = {0.7, 1.0, -2.0, 3.0};
  const PositionCost cost(fix);
  EXPECT_LT(pose_jacobian_error<3>(cost, {pose, alignment}, 0), 1e-6);
  Eigen::Matrix<double, 3, kAlignmentSize, Eigen::RowMajor> analytic;
  double* jacobians[] = {nullptr, analytic.data()};
  double* blocks[] = {pose, alignment};
  Eigen::Vector3d residuals, plus, minus;
  cost.Evaluate(blocks, residuals.data(), jacobians);
  for (int k = 0; k < kAlignmentSize; ++k) {
    const double kept = alignment[k];
    alignment[k] = kept + 1e-6;
    cost.Evaluate(blocks, plus.data(), nullptr);
    alignment[k] = kept - 1e-6;
    cost.Evaluate(blocks, minus.data(), nullptr);
    alignment[k] = kept;
    EXPECT_LT(((plus - minus) / 2e-6 - analytic.col(k)).norm(), 1e-6) << k;
  }
}

TEST(ExternalStepCost, JacobiansAreThoseOfTheResidual) {
  std::mt19937 random(6);
  ExternalStep step;
  const Eigen::Isometry3d T_from = random_pose(&random, 3.0, 10.0);
  step.measured.T_from_to = random_pose(&random, 1.0, 5.0);
  step.measured.information = random_information(&random);
  step.way = Eigen::Vector3d(2.0, 0.3, -0.4);
  double from[kPoseSize], to[kPoseSize], scale[] = {1.2};
  pose_to_block(T_from, from);
  pose_to_block(T_from * step.measured.T_from_to * random_pose(&random, 0.7, 1.0), to);
  const ExternalStepCost cost(step);
  EXPECT_LT(pose_jacobian_error<6>(cost, {from, to, scale}, 0), 1e-6);
  EXPECT_LT(pose_jacobian_error<6>(cost, {from, to, scale}, 1), 1e-6);
  // The residual is linear in the scale, and that of the relative pose where it is 1.
  Vector6d analytic, residuals, longer, relative;
  double* jacobians[] = {nullptr, nullptr, analytic.data()};
  const double* blocks[] = {from, to, scale};
  cost.Evaluate(blocks, residuals.data(), jacobians);
  scale[0] += 1.0;
  cost.Evaluate(blocks, longer.data(), nullptr);
  EXPECT_LT((longer - residuals - analytic).norm(), 1e-9);
  scale[0] = 1.0;
  cost.Evaluate(blocks, residuals.data(), nullptr);
  RelativePoseCost(step.measured).Evaluate(blocks, relative.data(), nullptr);
  EXPECT_LT((residuals - relative).norm(), 1e-12);
}

TEST(GravityCost, JacobianIsThatOfTheResidual) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 20; ++trial) {
    GravityDirection measured;
    measured.down_imu = random_pose(&random, 3.0, 1.0).linear().col(0);
    measured.down_map = Eigen::Vector3d(0.0, 0.0, -1.0);
    measured.sigma_rad = 0.3;
    double pose[kPoseSize];
    pose_to_block(random_pose(&random, 3.0, 20.0), pose);
    EXPECT_LT(pose_jacobian_error<3>(GravityCost(measured), {pose}, 0), 1e-6);
  }
}

/// A square driven twice with a random heading error in each step, and its true poses.
struct DriftingSquare {
  explicit DriftingSquare(double heading_sigma_rad) {
    std::mt19937 random(5);
    std::normal_distribution<double> heading_error(0.0, heading_sigma_rad);
    Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
    step.translation().x() = 1.0;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    for (int k = 0; k < 2 * kLap; ++k) {
      truth.push_back(T);
      step.linear() = so3::exp(Eigen::Vector3d(0.0, 0.0, k % 25 == 24 ? M_PI / 2 : 0.0));
      RelativePose edge;
      edge.from = k;
      edge.to = k + 1;
      edge.T_from_to = step;
      edge.T_from_to.rotate(so3::exp_q(Eigen::Vector3d(0.0, 0.0, heading_error(random))));
      edge.information.diagonal().head<3>().setConstant(std::pow(heading_sigma_rad, -2));
      edge.information.diagonal().tail<3>().setConstant(1e4);
      odometry.push_back(edge);
      T = T * step;
    }
    odometry.pop_back();
  }

  PoseGraph graph() const {
    PoseGraph graph{PoseGraphSettings()};
    graph.add_node(truth[0]);
    for (const RelativePose& edge : odometry) {
      graph.add_node(graph.pose(edge.from) * edge.T_from_to);
      graph.add_odometry(edge);
    }
    return graph;
  }

  RelativePose loop(std::size_t from, std::size_t to) const {
    RelativePose edge;
    edge.from = from;
    edge.to = to;
    edge.T_from_to = truth[from].inverse() * truth[to];
    edge.information = 1e4 * Matrix6d::Identity();
    return edge;
  }

  /// How far apart the graph has the same place in both laps.
  double worst_revisit(const PoseGraph& graph) const {
    double worst = 0.0;
    for (int k = 0; k < kLap; ++k)
      worst = std::max(worst, (graph.pose(k).translation() - graph.pose(k + kLap).translation()).norm());
    return worst;
  }

  static constexpr int kLap = 100;
  std::vector<Eigen::Isometry3d> truth;
  std::vector<RelativePose> odometry;
};

TEST(PoseGraph, LoopsTakeDriftBack) {
  const DriftingSquare square(0.02);
  PoseGraph graph = square.graph();
  ASSERT_GT(square.worst_revisit(graph), 4.0);
  for (std::size_t k = 0; k < 100; k += 10) graph.add_loop(square.loop(k, k + 100));
  ASSERT_TRUE(graph.solve());
  EXPECT_LT(square.worst_revisit(graph), 0.5);
  EXPECT_LT((graph.pose(0).matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-12);
}

TEST(PoseGraph, WhatWasSaidLastOfGravityCounts) {
  PoseGraph graph{PoseGraphSettings()};
  graph.add_node(Eigen::Isometry3d::Identity());
  graph.add_node(Eigen::Isometry3d::Identity());
  RelativePose step;
  step.from = 0;
  step.to = 1;
  step.information = Matrix6d::Identity();
  graph.add_odometry(step);
  const Eigen::Vector3d down(0.0, 0.0, -1.0);
  for (const double roll : {0.3, 0.1}) {
    const Eigen::Quaterniond q_map_imu = so3::exp_q(Eigen::Vector3d(roll, 0.0, 0.0));
    graph.set_gravity({1, q_map_imu.conjugate() * down, down, 1e-3});
    ASSERT_TRUE(graph.solve());
    EXPECT_NEAR(so3::log(Eigen::Matrix3d(graph.pose(1).linear())).x(), roll, 1e-4);
  }
}

TEST(PoseGraph, WrongLoopAmongTrueOnesLosesItsWeight) {
  const DriftingSquare square(0.02);
  PoseGraph graph = square.graph();
  for (std::size_t k = 0; k < 100; k += 10) graph.add_loop(square.loop(k, k + 100));
  RelativePose wrong = square.loop(5, 155);
  wrong.T_from_to.translation() += Eigen::Vector3d(-15.0, 10.0, 0.0);
  const std::size_t index = graph.add_loop(wrong);
  ASSERT_TRUE(graph.solve());
  EXPECT_LT(square.worst_revisit(graph), 0.5);
  EXPECT_LT(graph.loop_weight(index), 0.05);
  EXPECT_GT(graph.loop_weight(0), 0.9);
}

TEST(PoseGraph, LoopThatKnowsNothingAlongOneAxisDoesNotMoveThePoseAlongIt) {
  PoseGraph graph{PoseGraphSettings()};
  RelativePose edge;
  edge.to = 1;
  edge.T_from_to.translation().x() = 10.0;
  edge.information = 100.0 * Matrix6d::Identity();
  graph.add_node(Eigen::Isometry3d::Identity());
  graph.add_node(edge.T_from_to);
  graph.add_odometry(edge);
  edge.T_from_to.translation() = Eigen::Vector3d(12.0, 0.1, 0.0);
  edge.information *= 100.0;
  edge.information.row(3).setZero();
  edge.information.col(3).setZero();
  graph.add_loop(edge);
  ASSERT_TRUE(graph.solve());
  EXPECT_NEAR(graph.pose(1).translation().x(), 10.0, 1e-6);
  EXPECT_NEAR(graph.pose(1).translation().y(), 0.1, 2e-3);
}

/// A straight way of n equal steps and one loop over all of it, e off and with the information L of a step's
/// I: each step takes e / (n + I / L).
TEST(PoseGraph, LongWayBendsAsAWhole) {
  constexpr int kSteps = 3000;
  constexpr double kError = 0.01;
  PoseGraph graph{PoseGraphSettings()};
  RelativePose edge;
  edge.T_from_to.translation().x() = 1.0;
  edge.information.diagonal() << 1e8, 1e8, 1e8, 1e4, 1e4, 1e4;
  graph.add_node(Eigen::Isometry3d::Identity());
  for (int k = 0; k < kSteps; ++k) {
    edge.from = k;
    edge.to = graph.add_node(graph.pose(k) * edge.T_from_to);
    graph.add_odometry(edge);
  }
  RelativePose loop = edge;
  loop.from = 0;
  loop.T_from_to.translation().x() = kSteps + kError;
  graph.add_loop(loop);
  ASSERT_TRUE(graph.solve());
  const double step_error = kError / (kSteps + 1.0);
  EXPECT_NEAR(graph.pose(kSteps).translation().x(), kSteps * (1.0 + step_error), 0.05 * kError);
  EXPECT_NEAR(graph.pose(kSteps / 2).translation().x(), kSteps / 2 * (1.0 + step_error), 0.05 * kError);
}

TEST(PoseGraph, OneByOneGivesTheSameAsAllAtOnce) {
  const DriftingSquare square(5e-3);
  PoseGraph at_once = square.graph();
  PoseGraph one_by_one = square.graph();
  for (std::size_t k = 0; k < 100; k += 20) {
    at_once.add_loop(square.loop(k, k + 100));
    one_by_one.add_loop(square.loop(k, k + 100));
    ASSERT_TRUE(one_by_one.solve());
  }
  ASSERT_TRUE(at_once.solve());
  double apart = 0.0;
  for (std::size_t k = 0; k < square.truth.size(); ++k)
    apart = std::max(apart, (at_once.pose(k).translation() - one_by_one.pose(k).translation()).norm());
  EXPECT_LT(apart, 0.02);
}

TEST(PoseGraph, PositionsFixTheMapInEnu) {
  const DriftingSquare square(0.01);
  PoseGraph graph = square.graph();
  EnuAlignment truth;
  truth.yaw_rad = 1.1;
  truth.t_enu_map = Eigen::Vector3d(100.0, 50.0, 7.0);
  EnuAlignment start = truth;
  start.yaw_rad += 0.1;
  start.t_enu_map.x() += 2.0;
  graph.start_alignment(start);
  const Eigen::Vector3d p_imu(0.0, 0.3, 1.0);
  for (std::size_t k = 0; k < square.truth.size(); k += 5)
    graph.add_position({k, p_imu, truth.T_enu_map() * square.truth[k] * p_imu, Eigen::Matrix3d::Identity()});
  ASSERT_TRUE(graph.solve());
  double worst = 0.0;
  for (std::size_t k = 0; k < square.truth.size(); ++k) {
    const Eigen::Vector3d found = (graph.alignment().T_enu_map() * graph.pose(k)).translation();
    worst = std::max(worst, (found - (truth.T_enu_map() * square.truth[k]).translation()).norm());
  }
  // Fixes are exact but count as good to 1 m: odometry keeps its share.
  EXPECT_LT(worst, 1.0);
}

class GraphFiles : public testing::Test {
 protected:
  std::string path_ =
      (std::filesystem::temp_directory_path() / ("fdi_lio_graph_" + std::to_string(getpid()) + ".g2o"))
          .string();
  void TearDown() override { std::filesystem::remove(path_); }
};

TEST_F(GraphFiles, WhatIsWrittenIsReadBack) {
  std::mt19937 random(4);
  GraphFile graph;
  for (int k = 0; k < 3; ++k) graph.poses.push_back(random_pose(&random, 2.0, 30.0));
  graph.odometry = {{0, 1, random_pose(&random, 1.0, 2.0), random_information(&random)},
                    {1, 2, random_pose(&random, 1.0, 2.0), random_information(&random)}};
  graph.loops = {{0, 2, random_pose(&random, 1.0, 2.0), random_information(&random)}};
  write_g2o(path_, graph);
  const GraphFile read = read_g2o(path_);
  ASSERT_EQ(read.poses.size(), 3U);
  ASSERT_EQ(read.odometry.size(), 2U);
  ASSERT_EQ(read.loops.size(), 1U);
  EXPECT_TRUE(read.poses[2].isApprox(graph.poses[2], 1e-12));
  EXPECT_TRUE(read.loops[0].information.isApprox(graph.loops[0].information, 1e-9));
  EXPECT_TRUE(read.odometry[1].T_from_to.isApprox(graph.odometry[1].T_from_to, 1e-12));
}

TEST_F(GraphFiles, ForeignLinesAreNamed) {
  std::ofstream(path_) << "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE2 1 0 0 0\n";
  try {
    read_g2o(path_);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("line 2"));
  }
}

}  // namespace
}  // namespace fdi_lio::mapping
