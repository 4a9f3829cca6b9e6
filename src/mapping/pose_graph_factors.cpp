#include "fdi_lio/mapping/pose_graph_factors.hpp"

#include <cmath>

#include <Eigen/Eigenvalues>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::mapping {

namespace {

template <int Rows, int Columns>
using RowMajor = Eigen::Matrix<double, Rows, Columns, Eigen::RowMajor>;

/// A with A' A = H, for a positive semi-definite H.
template <int Size>
Eigen::Matrix<double, Size, Size> square_root(const Eigen::Matrix<double, Size, Size>& H) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, Size, Size>> solver(0.5 * (H + H.transpose()));
  return solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * solver.eigenvectors().transpose();
}

Eigen::Map<const Eigen::Quaterniond> rotation_of(const double* block) {
  return Eigen::Map<const Eigen::Quaterniond>(block);
}

Eigen::Map<const Eigen::Vector3d> translation_of(const double* block) {
  return Eigen::Map<const Eigen::Vector3d>(block + 4);
}

}  // namespace

void pose_to_block(const Eigen::Isometry3d& T, double* block) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(T.linear()).normalized();
  Eigen::Vector4d::Map(block) = q.coeffs();
  Eigen::Vector3d::Map(block + 4) = T.translation();
}

Eigen::Isometry3d block_to_pose(const double* block) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation_of(block).toRotationMatrix();
  T.translation() = translation_of(block);
  return T;
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Quaterniond q =
      (rotation_of(x) * so3::exp_q(Eigen::Map<const Eigen::Vector3d>(delta))).normalized();
  Eigen::Vector4d::Map(x_plus_delta) = q.coeffs();
  Eigen::Vector3d::Map(x_plus_delta + 4) = translation_of(x) + Eigen::Map<const Eigen::Vector3d>(delta + 3);
  return true;
}

bool PoseManifold::PlusJacobian(const double* /*x*/, double* jacobian) const {
  Eigen::Map<RowMajor<kPoseSize, kPoseTangentSize>> J(jacobian);
  J.setZero();
  J.topRows<kPoseTangentSize>().setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Vector3d::Map(y_minus_x) = so3::log(Eigen::Quaterniond(rotation_of(x).conjugate() * rotation_of(y)));
  Eigen::Vector3d::Map(y_minus_x + 3) = translation_of(y) - translation_of(x);
  return true;
}

bool PoseManifold::MinusJacobian(const double* /*x*/, double* jacobian) const {
  Eigen::Map<RowMajor<kPoseTangentSize, kPoseSize>> J(jacobian);
  J.setZero();
  J.leftCols<kPoseTangentSize>().setIdentity();
  return true;
}

RelativePoseCost::RelativePoseCost(const RelativePose& measured)
    : q_from_to_(measured.T_from_to.linear()),
      t_from_to_(measured.T_from_to.translation()),
      sqrt_information_(square_root<6>(measured.information)) {}

bool RelativePoseCost::Evaluate(double const* const* parameters, double* residuals,
                                double** jacobians) const {
  const Eigen::Quaterniond q_from = rotation_of(parameters[0]);
  const Eigen::Quaterniond q_to = rotation_of(parameters[1]);
  const Eigen::Quaterniond q_from_to = q_from.conjugate() * q_to;
  const Eigen::Vector3d t_from_to =
      q_from.conjugate() * (translation_of(parameters[1]) - translation_of(parameters[0]));
  Vector6d error;
  error.head<3>() = so3::log(Eigen::Quaterniond(q_from_to_.conjugate() * q_from_to));
  error.tail<3>() = t_from_to - t_from_to_;
  Vector6d::Map(residuals).noalias() = sqrt_information_ * error;
  if (jacobians == nullptr) return true;
  const Eigen::Matrix3d Jr_inverse = so3::right_jacobian_inverse(error.head<3>());
  const Eigen::Matrix3d R_map_from = q_from.toRotationMatrix();
  if (jacobians[0] != nullptr) {
    Matrix6d J = Matrix6d::Zero();
    J.topLeftCorner<3, 3>() = -Jr_inverse * q_from_to.conjugate().toRotationMatrix();
    J.bottomLeftCorner<3, 3>() = so3::hat(t_from_to);
    J.bottomRightCorner<3, 3>() = -R_map_from.transpose();
    Eigen::Map<RowMajor<6, kPoseSize>> out(jacobians[0]);
    out.leftCols<6>().noalias() = sqrt_information_ * J;
    out.col(6).setZero();
  }
  if (jacobians[1] != nullptr) {
    Matrix6d J = Matrix6d::Zero();
    J.topLeftCorner<3, 3>() = Jr_inverse;
    J.bottomRightCorner<3, 3>() = R_map_from.transpose();
    Eigen::Map<RowMajor<6, kPoseSize>> out(jacobians[1]);
    out.leftCols<6>().noalias() = sqrt_information_ * J;
    out.col(6).setZero();
  }
  return true;
}

bool ExternalStepCost::Evaluate(double const* const* parameters, double* residuals,
                                double** jacobians) const {
  relative_.Evaluate(parameters, residuals, jacobians);
  Vector6d::Map(residuals) -= (parameters[2][0] - 1.0) * scaled_;
  if (jacobians != nullptr && jacobians[2] != nullptr) Vector6d::Map(jacobians[2]) = -scaled_;
  return true;
}

bool ScalePriorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  residuals[0] = (parameters[0][0] - 1.0) / sigma_;
  if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = 1.0 / sigma_;
  return true;
}

PositionCost::PositionCost(const PositionFix& fix)
    : p_imu_(fix.p_imu), p_enu_(fix.p_enu), sqrt_information_(square_root<3>(fix.information)) {}

bool PositionCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Matrix3d R_map_imu = rotation_of(parameters[0]).toRotationMatrix();
  const Eigen::Vector3d p_map = R_map_imu * p_imu_ + translation_of(parameters[0]);
  const Eigen::Matrix3d R_enu_map =
      Eigen::AngleAxisd(parameters[1][0], Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d p_turned = R_enu_map * p_map;
  Eigen::Vector3d::Map(residuals).noalias() =
      sqrt_information_ * (p_turned + Eigen::Map<const Eigen::Vector3d>(parameters[1] + 1) - p_enu_);
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    Eigen::Map<RowMajor<3, kPoseSize>> out(jacobians[0]);
    out.leftCols<3>().noalias() = -sqrt_information_ * R_enu_map * R_map_imu * so3::hat(p_imu_);
    out.middleCols<3>(3).noalias() = sqrt_information_ * R_enu_map;
    out.col(6).setZero();
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<RowMajor<3, kAlignmentSize>> out(jacobians[1]);
    out.col(0).noalias() = sqrt_information_ * Eigen::Vector3d::UnitZ().cross(p_turned);
    out.rightCols<3>() = sqrt_information_;
  }
  return true;
}

bool GravityCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Matrix3d R_map_imu = rotation_of(parameters[0]).toRotationMatrix();
  const double weight = 1.0 / measured_.sigma_rad;
  Eigen::Vector3d::Map(residuals) = weight * (R_map_imu * measured_.down_imu - measured_.down_map);
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Map<RowMajor<3, kPoseSize>> out(jacobians[0]);
  out.setZero();
  out.leftCols<3>() = -weight * R_map_imu * so3::hat(measured_.down_imu);
  return true;
}

double GemanMcClureLoss::weight(double squared_norm) const {
  const double share = scale_sq_ / (scale_sq_ + squared_norm);
  return share * share;
}

void GemanMcClureLoss::Evaluate(double squared_norm, double rho[3]) const {
  const double sum = scale_sq_ + squared_norm;
  rho[0] = scale_sq_ * squared_norm / sum;
  rho[1] = weight(squared_norm);
  rho[2] = -2.0 * rho[1] / sum;
}

}  // namespace fdi_lio::mapping
