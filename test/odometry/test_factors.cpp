#include <functional>
#include <random>

#include "synthetic_motion.hpp"
#include <ceres/cost_function.h>
#include <gtest/gtest.h>

#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/factors.hpp"

namespace fdi_lio::odometry {
namespace {

/// Compares every Jacobian of `cost` with central differences at `blocks`.
void expect_jacobians_are_numeric(const ceres::CostFunction& cost, std::vector<Eigen::VectorXd> blocks,
                                  double tolerance) {
  const int rows = cost.num_residuals();
  std::vector<const double*> parameters;
  for (const auto& block : blocks) parameters.push_back(block.data());
  std::vector<std::vector<double>> storage;
  std::vector<double*> jacobians;
  for (const auto& block : blocks) storage.emplace_back(static_cast<std::size_t>(rows * block.size()));
  for (auto& jacobian : storage) jacobians.push_back(jacobian.data());
  Eigen::VectorXd residuals(rows);
  ASSERT_TRUE(cost.Evaluate(parameters.data(), residuals.data(), jacobians.data()));
  constexpr double kStep = 1e-6;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (Eigen::Index column = 0; column < blocks[b].size(); ++column) {
      Eigen::VectorXd up(rows);
      Eigen::VectorXd down(rows);
      const double value = blocks[b][column];
      blocks[b][column] = value + kStep;
      cost.Evaluate(parameters.data(), up.data(), nullptr);
      blocks[b][column] = value - kStep;
      cost.Evaluate(parameters.data(), down.data(), nullptr);
      blocks[b][column] = value;
      const Eigen::VectorXd numeric = (up - down) / (2.0 * kStep);
      for (int row = 0; row < rows; ++row) {
        const double analytic = storage[b][static_cast<std::size_t>(row * blocks[b].size() + column)];
        EXPECT_NEAR(analytic, numeric[row], tolerance * (1.0 + std::abs(numeric[row])))
            << "block " << b << " row " << row << " column " << column;
      }
    }
  }
}

class Factors : public testing::Test {
 protected:
  Eigen::VectorXd random(Eigen::Index size, double scale) {
    std::normal_distribution<double> normal(0.0, scale);
    Eigen::VectorXd v(size);
    for (Eigen::Index k = 0; k < size; ++k) v[k] = normal(generator_);
    return v;
  }

  imu::Preintegration preintegration() const {
    const auto samples = motion_.samples(0.5, 0.6, 100.0);
    return imu::preintegrate(samples, samples.front().stamp, samples.back().stamp,
                             {Eigen::Vector3d(0.01, 0.0, -0.01), Eigen::Vector3d(0.1, 0.05, 0.0)},
                             imu::ImuNoise(), ImuConfig());
  }

  std::mt19937 generator_{3};
  imu::SyntheticMotion motion_;
};

TEST_F(Factors, MotionJacobiansAreNumericAwayFromZero) {
  for (const bool with_gravity : {true, false}) {
    const MotionCost cost(motion_.state(0.5), motion_.state(0.6), preintegration(), with_gravity,
                          Eigen::Vector3d(0.3, -0.8, 0.2));
    expect_jacobians_are_numeric(cost, {random(15, 0.05), random(15, 0.05), random(kSharedSize, 0.1)}, 2e-4);
  }
}

TEST_F(Factors, MotionResidualIsZeroOnTheTrueMotion) {
  for (const Eigen::Vector3d& mounting : {Eigen::Vector3d(0.0, 0.0, 0.0), Eigen::Vector3d(0.3, -0.2, 0.5)}) {
    motion_.mounting = mounting;
    const auto samples = motion_.samples(0.5, 0.6, 2000.0);
    const auto p = imu::preintegrate(samples, samples.front().stamp, samples.back().stamp, {},
                                     imu::ImuNoise(), ImuConfig());
    const MotionCost cost(motion_.state(0.5), motion_.state(0.6), p, true, Eigen::Vector3d(0.0, -0.5, 0.0));
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(15);
    const double* parameters[] = {zero.data(), zero.data(), zero.data()};
    Eigen::VectorXd residuals(15);
    cost.Evaluate(parameters, residuals.data(), nullptr);
    EXPECT_LT(residuals.norm(), 0.02) << mounting.transpose();  // in standard deviations
  }
}

TEST_F(Factors, MotionResidualIsZeroInAMapThatBends) {
  const auto samples = motion_.samples(0.5, 0.6, 2000.0);
  const auto p = imu::preintegrate(samples, samples.front().stamp, samples.back().stamp, {},
                                   imu::ImuNoise{1e-2, 1e-1, 1e-5, 1e-4}, ImuConfig());
  imu::NavState i = motion_.state(0.5);
  imu::NavState j = motion_.state(0.6);
  const Eigen::Vector3d bend(0.01, -0.03, 0.02);
  i.beam_elevation = j.beam_elevation = 0.02;
  // What the map turns by about the axes of the odometry, at the end of the step and on the mean of it.
  const Eigen::Vector3d turn = i.q_odom_imu * bend * i.beam_elevation;
  j.q_odom_imu = so3::exp_q(turn) * j.q_odom_imu;
  j.v_odom = so3::exp_q(turn) * j.v_odom;
  j.t_odom_imu = i.t_odom_imu + so3::exp_q(Eigen::Vector3d(0.5 * turn)) * (j.t_odom_imu - i.t_odom_imu);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(15);
  const double* parameters[] = {zero.data(), zero.data(), zero.data()};
  Eigen::VectorXd residuals(15);
  MotionCost(i, j, p, true, bend).Evaluate(parameters, residuals.data(), nullptr);
  EXPECT_LT(residuals.norm(), 0.02);
  MotionCost(i, j, p, true, Eigen::Vector3d::Zero()).Evaluate(parameters, residuals.data(), nullptr);
  EXPECT_GT(residuals.norm(), 0.1);
}

TEST(MapBend, IsUpwardsByTheStepOverTheRadius) {
  // Ahead along x with the spin axis along z: nose up is about -y. Backwards the tail goes up.
  EXPECT_TRUE(map_bend(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(2.0, 0.0, 0.0), 20.0)
                  .isApprox(Eigen::Vector3d(0.0, -0.1, 0.0)));
  EXPECT_TRUE(map_bend(Eigen::Vector3d::UnitZ(), Eigen::Vector3d(-2.0, 0.0, 0.0), 20.0)
                  .isApprox(Eigen::Vector3d(0.0, 0.1, 0.0)));
  // A step along the spin axis bends nothing.
  EXPECT_TRUE(map_bend(Eigen::Vector3d::UnitX(), Eigen::Vector3d(2.0, 0.0, 0.0), 20.0).isZero());
}

TEST_F(Factors, LidarJacobianIsNumericAndCostIsTheQuadraticModel) {
  const Eigen::MatrixXd half = Eigen::MatrixXd::Map(random(36, 1.0).data(), 6, 6);
  matching::LidarInformation information;
  information.H = half * half.transpose();
  information.b = information.H * random(6, 1.0);
  const imu::NavState nominal = motion_.state(0.5);
  information.q_odom_imu = nominal.q_odom_imu;
  information.t_odom_imu = nominal.t_odom_imu;
  const LidarCost cost(nominal, information);
  expect_jacobians_are_numeric(cost, {random(15, 0.1)}, 1e-5);

  const auto cost_at = [&cost](const Eigen::VectorXd& block) {
    const double* parameters[] = {block.data()};
    Eigen::VectorXd residuals(6);
    cost.Evaluate(parameters, residuals.data(), nullptr);
    return 0.5 * residuals.squaredNorm();
  };
  Eigen::VectorXd d = Eigen::VectorXd::Zero(15);
  d.head<6>() = random(6, 0.3);
  const Vector6d d6 = d.head<6>();
  EXPECT_NEAR(cost_at(d) - cost_at(Eigen::VectorXd::Zero(15)),
              0.5 * d6.dot(information.H * d6) + information.b.dot(d6), 1e-8);
}

TEST_F(Factors, PriorJacobiansAreNumeric) {
  StatePrior prior;
  prior.linearisation = motion_.state(0.52);
  prior.sqrt_information =
      Eigen::MatrixXd::Map(random(kPriorSize * kPriorSize, 1.0).data(), kPriorSize, kPriorSize);
  prior.offset = random(kPriorSize, 1.0);
  expect_jacobians_are_numeric(PriorCost(motion_.state(0.5), prior),
                               {random(15, 0.1), random(kSharedSize, 0.1)}, 1e-5);
}

TEST_F(Factors, GravityJacobianIsNumeric) {
  expect_jacobians_are_numeric(GravityNormCost(motion_.state(0.5), 9.81), {random(kSharedSize, 0.1)}, 1e-5);
}

TEST(Factorise, RootReproducesTheNormalEquationsAndLeavesOutTheNullSpace) {
  Eigen::MatrixXd J(2, 3);
  J << 1.0, 2.0, 3.0, 0.5, -1.0, 4.0;
  const Eigen::MatrixXd H = J.transpose() * J;
  const Eigen::VectorXd b = H * Eigen::Vector3d(1.0, -2.0, 0.5);
  Eigen::MatrixXd A;
  Eigen::VectorXd e;
  factorise(H, b, 1e-12, &A, &e);
  EXPECT_TRUE((A.transpose() * A).isApprox(H, 1e-10));
  EXPECT_TRUE((A.transpose() * e).isApprox(b, 1e-10));
}

}  // namespace
}  // namespace fdi_lio::odometry
