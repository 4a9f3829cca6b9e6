#include <cmath>

#include <gtest/gtest.h>
#include <unsupported/Eigen/MatrixFunctions>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio {
namespace {

class So3AtAngle : public testing::TestWithParam<double> {
 protected:
  Eigen::Vector3d phi() const { return GetParam() * Eigen::Vector3d(1.0, -2.0, 0.5).normalized(); }
};

TEST_P(So3AtAngle, ExpIsTheMatrixExponential) {
  EXPECT_TRUE(so3::exp(phi()).isApprox(so3::hat(phi()).exp(), 1e-12));
}

TEST_P(So3AtAngle, LogUndoesExp) { EXPECT_LT((so3::log(so3::exp_q(phi())) - phi()).norm(), 1e-10); }

TEST_P(So3AtAngle, RightJacobianIsTheNumericDerivative) {
  constexpr double kStep = 1e-6;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d d = kStep * Eigen::Vector3d::Unit(axis);
    const Eigen::Quaterniond turn =
        so3::exp_q(Eigen::Vector3d(phi() - d)).conjugate() * so3::exp_q(Eigen::Vector3d(phi() + d));
    const Eigen::Vector3d numeric = so3::log(turn) / (2.0 * kStep);
    EXPECT_LT((so3::right_jacobian(phi()).col(axis) - numeric).norm(), 1e-8);
  }
}

TEST_P(So3AtAngle, InverseJacobianIsTheInverse) {
  EXPECT_TRUE((so3::right_jacobian(phi()) * so3::right_jacobian_inverse(phi()))
                  .isApprox(Eigen::Matrix3d::Identity(), 1e-9));
}

INSTANTIATE_TEST_SUITE_P(Angles, So3AtAngle, testing::Values(0.0, 1e-9, 5e-5, 1.5e-4, 0.1, 1.0, 3.0));

TEST(So3, LogTakesTheShortWay) {
  const Eigen::Quaterniond q = so3::exp_q(Eigen::Vector3d(0.0, 0.0, 0.2));
  EXPECT_NEAR(so3::log(Eigen::Quaterniond(-q.coeffs())).z(), 0.2, 1e-12);
}

}  // namespace
}  // namespace fdi_lio
