#pragma once

#include <Eigen/Core>
#include <ceres/sized_cost_function.h>

#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/matching/scan_matcher.hpp"

/// Cost functions of the fixed-lag smoother. Every parameter block is a perturbation of a nominal state, in
/// the tangent order of docs/conventions.md: state [dtheta, dt, dv, db_g, db_a] (15), and what all states of
/// the window share, [gravity dg, mounting, beam elevation, lidar time offset, gyro scale column by column]
/// (17). Jacobians are analytic.
namespace fdi_lio::odometry {

constexpr int kStateSize = 15;
constexpr int kSharedSize = 17;
constexpr int kPriorSize = kStateSize + kSharedSize;

using Vector15d = Eigen::Matrix<double, kStateSize, 1>;
using Matrix15d = Eigen::Matrix<double, kStateSize, kStateSize>;
using SharedVector = Eigen::Matrix<double, kSharedSize, 1>;
using PriorVector = Eigen::Matrix<double, kPriorSize, 1>;
using PriorMatrix = Eigen::Matrix<double, kPriorSize, kPriorSize>;

/// `state` moved by the perturbations.
imu::NavState apply(const imu::NavState& state, const double* delta_state, const double* delta_shared);

/// Motion between two states by preintegrated IMU (Forster et al., TRO 2017, eq. 45, and bias random walk),
/// whitened by the preintegration's covariance. Blocks: state i, state j, shared. The attitudes in it are
/// those of the IMU, R Exp(mounting). Without gravity (constant velocity, or an IMU whose gravity is unknown)
/// the velocity change is taken as it is, and the mounting as stated.
///
/// `bend` k (map_bend()): what the frame of the states turned by from i to j for each radian of
/// NavState::beam_elevation = c, in the axes of the body at i. Seen from a frame that does not turn, R_i' R_j
/// is E R_i' R_j with E = Exp(-k c), the velocity at j turns alike, and the step by half of it.
class MotionCost : public ceres::SizedCostFunction<15, kStateSize, kStateSize, kSharedSize> {
 public:
  MotionCost(const imu::NavState& nominal_i, const imu::NavState& nominal_j,
             const imu::Preintegration& preintegration, bool with_gravity, const Eigen::Vector3d& bend);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  imu::NavState nominal_i_;
  imu::NavState nominal_j_;
  imu::Preintegration preintegration_;
  bool with_gravity_;
  Eigen::Vector3d bend_;
  Matrix15d sqrt_information_;
};

/// The condensed scan-to-map residuals of one scan: r = L' d + L^-1 b with H = L L' and d the pose's
/// difference from the linearisation point, so that r' r / 2 is LidarInformation's cost. Directions without
/// information have no residual.
class LidarCost : public ceres::SizedCostFunction<6, kStateSize> {
 public:
  LidarCost(const imu::NavState& nominal, const matching::LidarInformation& information);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  imu::NavState nominal_;
  matching::LidarInformation information_;
  Matrix6d sqrt_information_;
  Vector6d offset_;
};

/// What is left of marginalised states: a Gaussian of the oldest state and the shared values about
/// `linearisation`.
struct StatePrior {
  imu::NavState linearisation;
  PriorMatrix sqrt_information = PriorMatrix::Zero();
  PriorVector offset = PriorVector::Zero();
};

/// r = A ([state, shared] - linearisation) + offset. Blocks: state, shared.
class PriorCost : public ceres::SizedCostFunction<kPriorSize, kStateSize, kSharedSize> {
 public:
  PriorCost(const imu::NavState& nominal, const StatePrior& prior);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  imu::NavState nominal_;
  StatePrior prior_;
};

/// Keeps the magnitude of gravity: r = (|g| - known) / sigma. Block: shared.
class GravityNormCost : public ceres::SizedCostFunction<1, kSharedSize> {
 public:
  GravityNormCost(const imu::NavState& nominal, double magnitude_mps2);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d g_odom_;
  double magnitude_;
};

/// What the map turns by on a step, for each radian that all beams point too high, in the axes of the body.
/// Level ground looks like a cone about the sensor, higher all around. What lies ahead is laid into the map
/// with that slope, and is what the sensor drives on later: the map turns by ds / L upwards, about the axis
/// that lies across the step and the spin axis. `radius_m` L: root mean square distance of the features.
Eigen::Vector3d map_bend(const Eigen::Vector3d& spin_axis, const Eigen::Vector3d& step_m, double radius_m);

/// Square root A and offset e with A' A = H and A' e = b for a positive semi-definite H; directions whose
/// eigenvalue is below `relative_tolerance` times the largest are left out.
void factorise(const Eigen::MatrixXd& H, const Eigen::VectorXd& b, double relative_tolerance,
               Eigen::MatrixXd* A, Eigen::VectorXd* e);

}  // namespace fdi_lio::odometry
