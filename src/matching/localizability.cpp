#include "fdi_lio/matching/localizability.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::matching {

namespace {

constexpr double kLeastRadius = 0.1;  ///< of the features about their centroid [m]: keeps the scaling regular

constexpr double kMostOfSlope = 0.9;  ///< that a correction of the gradient may take away

/// ds / d[dtheta, dt].
Matrix6d scaling(const LidarInformation& information) {
  Matrix6d S = Matrix6d::Zero();
  S.topLeftCorner<3, 3>() = std::max(information.radius_m, kLeastRadius) * Eigen::Matrix3d::Identity();
  S.bottomLeftCorner<3, 3>() = -so3::hat(information.centroid_imu);
  S.bottomRightCorner<3, 3>() = information.q_odom_imu.toRotationMatrix().transpose();
  return S;
}

/// Information in s of information about [dtheta, dt].
Matrix6d scaled(const Matrix6d& H, const Matrix6d& S_inverse) {
  const Matrix6d result = S_inverse.transpose() * H * S_inverse;
  return 0.5 * (result + result.transpose());
}

double normal_distribution(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

}  // namespace

Localizability analyse_localizability(const LidarInformation& information, double margin) {
  Localizability result;
  if (information.independent <= 0.0 || !information.H.allFinite()) return result;
  const Matrix6d S_inverse = scaling(information).inverse();
  const Matrix6d E = scaled(information.noise_information, S_inverse);
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(scaled(information.H, S_inverse));
  for (int k = 0; k < 6; ++k) {
    // Eigen sorts ascending; the best observed axis comes first here.
    const Eigen::Matrix<double, 6, 1> axis = solver.eigenvectors().col(5 - k);
    const double h = std::max(0.0, solver.eigenvalues()[5 - k]);
    const double e = std::max(0.0, axis.dot(E * axis));
    const double noise = margin * e;
    const double variance = (2.0 * noise * noise + 4.0 * h * noise) / information.independent;
    result.axes.col(k) = axis;
    result.information[k] = h;
    result.noise_information[k] = e;
    result.probability[k] =
        variance > 0.0 ? normal_distribution((h - noise) / std::sqrt(variance)) : (h > 0.0 ? 1.0 : 0.0);
  }
  return result;
}

void remove_bias(const Localizability& localizability, LidarInformation* information) {
  Vector6d factor = Vector6d::Ones();
  for (int k = 0; k < 6; ++k) {
    const double h = kMostOfSlope * localizability.information[k];
    if (localizability.noise_information[k] > h) factor[k] = h / localizability.noise_information[k];
  }
  const Matrix6d S = scaling(*information);
  information->b -= S.transpose() * localizability.axes * factor.asDiagonal() *
                    localizability.axes.transpose() * S.inverse().transpose() * information->bias;
  information->bias.setZero();
}

void add_in_weak_directions(const Localizability& localizability, const LidarInformation& further,
                            LidarInformation* information) {
  const Matrix6d S = scaling(*information);
  const Vector6d open = Vector6d::Ones() - localizability.probability;
  // About [dtheta, dt]: a residual's Jacobian J becomes S' P S^-T J.
  const Matrix6d P = S.transpose() * localizability.axes * open.asDiagonal() *
                     localizability.axes.transpose() * S.inverse().transpose();
  information->H += P * further.H * P.transpose();
  information->b += P * further.b;
  information->noise_information += P * further.noise_information * P.transpose();
  information->textures += further.textures;
}

void soften(const Localizability& localizability, LidarInformation* information) {
  if (localizability.probability.minCoeff() >= 1.0) return;
  const Matrix6d S = scaling(*information);
  const Matrix6d to_axes = localizability.axes.transpose() * S;
  const Vector6d b_axes = localizability.axes.transpose() * S.inverse().transpose() * information->b;
  const Vector6d p = localizability.probability;
  information->H = to_axes.transpose() * (p.cwiseProduct(localizability.information)).asDiagonal() * to_axes;
  information->b = to_axes.transpose() * p.cwiseProduct(b_axes);
}

}  // namespace fdi_lio::matching
