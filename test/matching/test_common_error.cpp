#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/matching/common_error.hpp"

namespace fdi_lio::matching {
namespace {

/// Of residuals with Jacobians J and values r, each of variance 1.
LidarInformation information_of(const Eigen::Matrix<double, Eigen::Dynamic, 6>& J, const Eigen::VectorXd& r) {
  LidarInformation information;
  information.H = J.transpose() * J;
  information.b = J.transpose() * r;
  information.radius_m = 8.0;
  return information;
}

Eigen::MatrixXd random_matrix(int rows, int cols, std::mt19937* generator) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&]() { return normal(*generator); });
}

TEST(CommonError, IsThatOfAllResidualsTogether) {
  // Against generalised least squares with the full covariance of the residuals, I + J S J'.
  std::mt19937 generator(3);
  const Eigen::MatrixXd J = random_matrix(40, 6, &generator);
  const Eigen::VectorXd r = random_matrix(40, 1, &generator);
  const double sigma_rad = 0.02;
  const Matrix6d S = isotropic(sigma_rad, 8.0 * sigma_rad);
  const Eigen::MatrixXd W = (Eigen::MatrixXd::Identity(40, 40) + J * S * J.transpose()).inverse();
  LidarInformation information = information_of(J, r);
  add_common_error(sigma_rad, &information);
  EXPECT_LT((information.H - J.transpose() * W * J).norm(), 1e-9 * information.H.norm());
  EXPECT_LT((information.b - J.transpose() * W * r).norm(), 1e-9 * information.b.norm());
}

TEST(CommonError, LeavesThePoseOfTheScan) {
  std::mt19937 generator(4);
  LidarInformation information =
      information_of(random_matrix(30, 6, &generator), random_matrix(30, 1, &generator));
  const Vector6d step = information.H.inverse() * information.b;
  add_common_error(0.1, &information);
  EXPECT_LT((information.H.inverse() * information.b - step).norm(), 1e-9);
}

TEST(CommonError, LeavesOpenWhatIsOpen) {
  std::mt19937 generator(5);
  Eigen::MatrixXd J = random_matrix(30, 6, &generator);
  J.col(4).setZero();
  LidarInformation information = information_of(J, random_matrix(30, 1, &generator));
  add_common_error(0.1, &information);
  EXPECT_TRUE(information.H.allFinite());
  EXPECT_LT(information.H.row(4).norm() + information.H.col(4).norm(), 1e-12);
  EXPECT_LT(std::abs(information.b[4]), 1e-12);
}

}  // namespace
}  // namespace fdi_lio::matching
