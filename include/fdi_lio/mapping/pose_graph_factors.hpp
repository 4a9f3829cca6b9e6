#pragma once

#include <ceres/loss_function.h>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include "fdi_lio/mapping/pose_graph.hpp"

/// Cost functions of the pose graph. A pose block is [qx qy qz qw tx ty tz] with the tangent [dtheta, dt] of
/// docs/conventions.md.
namespace fdi_lio::mapping {

constexpr int kPoseSize = 7;
constexpr int kPoseTangentSize = 6;
constexpr int kAlignmentSize = 4;  ///< [yaw, tx, ty, tz] of EnuAlignment

void pose_to_block(const Eigen::Isometry3d& T, double* block);
Eigen::Isometry3d block_to_pose(const double* block);

/// R <- R Exp(dtheta), t <- t + dt. PlusJacobian is [I; 0] and the cost functions write their derivatives by
/// the tangent into the first six columns, so that nothing is multiplied out twice.
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kPoseSize; }
  int TangentSize() const override { return kPoseTangentSize; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

/// r = A [Log(R_ft' R_f' R_t), R_f' (t_t - t_f) - t_ft] with A' A the information. Blocks: from, to.
class RelativePoseCost : public ceres::SizedCostFunction<6, kPoseSize, kPoseSize> {
 public:
  explicit RelativePoseCost(const RelativePose& measured);
  const Matrix6d& sqrt_information() const { return sqrt_information_; }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Quaterniond q_from_to_;
  Eigen::Vector3d t_from_to_;
  Matrix6d sqrt_information_;
};

/// The same with R_f' (t_t - t_f) - (t_ft + (s - 1) w) for the translation: w the way in t_ft, s the scale.
/// Blocks: from, to, scale.
class ExternalStepCost : public ceres::SizedCostFunction<6, kPoseSize, kPoseSize, 1> {
 public:
  explicit ExternalStepCost(const ExternalStep& step) : relative_(step.measured) {
    scaled_ = relative_.sqrt_information().rightCols<3>() * step.way;
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  RelativePoseCost relative_;
  Vector6d scaled_;  ///< A [0, w]
};

/// r = (s - 1) / sigma.
class ScalePriorCost : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit ScalePriorCost(double sigma) : sigma_(sigma) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  double sigma_;
};

/// r = A (R_z(yaw) (R p_imu + t) + t_enu_map - p_enu) with A' A the information. Blocks: pose, alignment.
class PositionCost : public ceres::SizedCostFunction<3, kPoseSize, kAlignmentSize> {
 public:
  explicit PositionCost(const PositionFix& fix);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d p_imu_;
  Eigen::Vector3d p_enu_;
  Eigen::Matrix3d sqrt_information_;
};

/// r = (R d_imu - d_map) / sigma, d: down. Turning about the vertical changes nothing. Block: pose.
class GravityCost : public ceres::SizedCostFunction<3, kPoseSize> {
 public:
  explicit GravityCost(const GravityDirection& measured) : measured_(measured) {}
  void set_measured(const GravityDirection& measured) { measured_ = measured; }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  GravityDirection measured_;
};

/// rho(s) = a s / (a + s): quadratic near zero, constant far away.
class GemanMcClureLoss : public ceres::LossFunction {
 public:
  explicit GemanMcClureLoss(double scale_sq) : scale_sq_(scale_sq) {}
  void set_scale_sq(double scale_sq) { scale_sq_ = scale_sq; }
  double weight(double squared_norm) const;
  void Evaluate(double squared_norm, double rho[3]) const override;

 private:
  double scale_sq_;
};

}  // namespace fdi_lio::mapping
