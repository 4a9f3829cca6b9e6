#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/odometry/mounting.hpp"

namespace fdi_lio::odometry {
namespace {

TEST(Mounting, CovarianceIsThatOfSampledMountings) {
  Eigen::Isometry3d T_odom_first = Eigen::Isometry3d::Identity();
  T_odom_first.linear() = so3::exp(Eigen::Vector3d(0.02, -0.05, 0.8));
  T_odom_first.translation() = Eigen::Vector3d(3.0, -1.0, 0.5);
  Eigen::Isometry3d T_odom_now = Eigen::Isometry3d::Identity();
  T_odom_now.linear() = so3::exp(Eigen::Vector3d(0.1, 0.05, 2.1));
  T_odom_now.translation() = Eigen::Vector3d(40.0, 15.0, 2.0);
  constexpr double kSigma = 0.004;
  std::mt19937 generator(12);
  std::normal_distribution<double> normal(0.0, kSigma);
  Matrix6d sampled = Matrix6d::Zero();
  constexpr int kSamples = 40000;
  const Eigen::Isometry3d T_rel = T_odom_first.inverse() * T_odom_now;
  for (int k = 0; k < kSamples; ++k) {
    // The truth is as stated; the system believes in a mounting that lacks delta.
    const Eigen::Isometry3d delta(
        so3::exp(Eigen::Vector3d(normal(generator), normal(generator), normal(generator))));
    const Eigen::Isometry3d T_believed = T_odom_first * delta.inverse() * T_rel * delta;
    Vector6d error;
    error << so3::log(Eigen::Matrix3d(T_believed.linear().transpose() * T_odom_now.linear())),
        T_odom_now.translation() - T_believed.translation();
    sampled += error * error.transpose() / kSamples;
  }
  const Matrix6d stated = mounting_covariance(T_odom_first, T_odom_now, kSigma);
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(stated(k, k), sampled(k, k), 0.03 * sampled(k, k)) << k;
  EXPECT_LT((stated - sampled).norm(), 0.03 * sampled.norm());
}

TEST(Mounting, NothingAtTheFirstPose) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = 7.0;
  EXPECT_LT(mounting_covariance(T, T, 0.01).norm(), 1e-15);
}

TEST(Mounting, CorrectedRotationTakesLidarAxesIntoThoseOfTheImu) {
  const Eigen::Quaterniond q_stated(so3::exp_q(Eigen::Vector3d(0.2, -0.1, 1.5)));
  const Eigen::Vector3d mounting(0.03, -0.02, 0.04);
  // A pose takes the stated rotation for right: its axes are the lidar's seen through that. What lies along x
  // of the IMU lies along Exp(mounting) x of the pose.
  const Eigen::Vector3d x_pose = so3::exp(mounting) * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d x_lidar = q_stated.conjugate() * x_pose;
  EXPECT_LT((corrected_rotation(q_stated, mounting) * x_lidar - Eigen::Vector3d::UnitX()).norm(), 1e-12);
}

}  // namespace
}  // namespace fdi_lio::odometry
