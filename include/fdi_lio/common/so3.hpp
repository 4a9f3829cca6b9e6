#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

/// Rotations. Exp, Log and the right Jacobian follow Forster et al., "On-Manifold Preintegration for
/// Real-Time Visual-Inertial Odometry", TRO 2017, eqs. (3)-(9).
namespace fdi_lio::so3 {

/// Skew-symmetric matrix: hat(a) * b = a x b.
inline Eigen::Matrix3d hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0.0, -a.z(), a.y(), a.z(), 0.0, -a.x(), -a.y(), a.x(), 0.0;
  return m;
}

/// Rotation by |phi| radians about phi, as a unit quaternion; smooth through zero.
inline Eigen::Quaterniond exp_q(const Eigen::Vector3d& phi) {
  const double angle_sq = phi.squaredNorm();
  double real = 0.0;
  double imaginary_scale = 0.0;
  if (angle_sq < 1e-8) {
    real = 1.0 - angle_sq / 8.0;
    imaginary_scale = 0.5 - angle_sq / 48.0;
  } else {
    const double angle = std::sqrt(angle_sq);
    real = std::cos(0.5 * angle);
    imaginary_scale = std::sin(0.5 * angle) / angle;
  }
  return Eigen::Quaterniond(real, imaginary_scale * phi.x(), imaginary_scale * phi.y(),
                            imaginary_scale * phi.z());
}

/// Rotation by |phi| radians about phi, as a matrix.
inline Eigen::Matrix3d exp(const Eigen::Vector3d& phi) { return exp_q(phi).toRotationMatrix(); }

/// Rotation vector of a unit quaternion, with angle in [0, pi].
inline Eigen::Vector3d log(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double w = sign * q.w();
  const double sine = v.norm();
  if (sine < 1e-6) return v * (2.0 / w);
  return v * (2.0 * std::atan2(sine, w) / sine);
}

/// Rotation vector of a rotation matrix, with angle in [0, pi].
inline Eigen::Vector3d log(const Eigen::Matrix3d& rotation) { return log(Eigen::Quaterniond(rotation)); }

/// Right Jacobian: Exp(phi + d) ~ Exp(phi) Exp(Jr(phi) d).
inline Eigen::Matrix3d right_jacobian(const Eigen::Vector3d& phi) {
  const double angle_sq = phi.squaredNorm();
  const Eigen::Matrix3d skew = hat(phi);
  if (angle_sq < 1e-8) return Eigen::Matrix3d::Identity() - 0.5 * skew + skew * skew / 6.0;
  const double angle = std::sqrt(angle_sq);
  return Eigen::Matrix3d::Identity() - (1.0 - std::cos(angle)) / angle_sq * skew +
         (angle - std::sin(angle)) / (angle_sq * angle) * skew * skew;
}

/// Inverse of the right Jacobian: Log(Exp(phi) Exp(d)) ~ phi + Jr^-1(phi) d, for |phi| < 2 pi.
inline Eigen::Matrix3d right_jacobian_inverse(const Eigen::Vector3d& phi) {
  const double angle_sq = phi.squaredNorm();
  const Eigen::Matrix3d skew = hat(phi);
  if (angle_sq < 1e-8) return Eigen::Matrix3d::Identity() + 0.5 * skew + skew * skew / 12.0;
  const double angle = std::sqrt(angle_sq);
  return Eigen::Matrix3d::Identity() + 0.5 * skew +
         (1.0 / angle_sq - (1.0 + std::cos(angle)) / (2.0 * angle * std::sin(angle))) * skew * skew;
}

}  // namespace fdi_lio::so3
