#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/so3.hpp"

/// The tangent [dtheta (body), dt (reference axes)] of poses in the graph and in registrations.
namespace fdi_lio {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// T moved by delta: R exp(dtheta), t + dt.
inline Eigen::Isometry3d moved(const Eigen::Isometry3d& T, const Vector6d& delta) {
  Eigen::Isometry3d result = T;
  result.linear() = T.linear() * so3::exp(delta.head<3>());
  result.translation() += delta.tail<3>();
  return result;
}

/// The delta with moved(from, delta) = to.
inline Vector6d difference(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  Vector6d delta;
  delta << so3::log(Eigen::Matrix3d(from.linear().transpose() * to.linear())),
      to.translation() - from.translation();
  return delta;
}

/// The pose at `share` of the way from one to another: turning and moving evenly.
inline Eigen::Isometry3d interpolated(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to,
                                      double share) {
  const Eigen::Isometry3d T_step = from.inverse() * to;
  Eigen::Isometry3d T_part = Eigen::Isometry3d::Identity();
  T_part.linear() = so3::exp(share * so3::log(Eigen::Matrix3d(T_step.linear())));
  T_part.translation() = share * T_step.translation();
  return from * T_part;
}

/// Covariance with the same standard deviation about all axes and along all axes.
inline Matrix6d isotropic(double sigma_rad, double sigma_m) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(sigma_rad * sigma_rad);
  covariance.diagonal().tail<3>().setConstant(sigma_m * sigma_m);
  return covariance;
}

}  // namespace fdi_lio
