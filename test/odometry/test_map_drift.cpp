#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/odometry/map_drift.hpp"

namespace fdi_lio::odometry {
namespace {

imu::NavState at(double x, double yaw_rad) {
  imu::NavState state;
  state.t_odom_imu = Eigen::Vector3d(x, 0.0, 0.0);
  state.q_odom_imu = so3::exp_q(Eigen::Vector3d(0.0, 0.0, yaw_rad));
  state.g_odom = Eigen::Vector3d(0.0, 0.0, -9.81);
  return state;
}

Matrix6d diagonal(double rotation, double translation) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << rotation, rotation, rotation, translation, translation, translation;
  return covariance;
}

TEST(MapDrift, StandingStillAddsNothing) {
  MapDrift drift(1.0);
  for (int k = 0; k < 10; ++k) drift.advance(at(0.0, 0.0), at(0.0, 0.0), diagonal(1e-6, 1e-4), 10.0);
  EXPECT_EQ(drift.covariance(), Matrix6d::Zero());
}

TEST(MapDrift, EachRadiusOfWayAddsOneCovarianceAndRollAndPitchNone) {
  MapDrift drift(1.0);
  for (int k = 0; k < 30; ++k) drift.advance(at(k, 0.0), at(k + 1.0, 0.0), diagonal(0.0, 1e-4), 10.0);
  EXPECT_NEAR(drift.covariance()(3, 3), 3e-4, 1e-12);
  MapDrift turning(1.0);
  for (int k = 0; k < 30; ++k) turning.advance(at(k, 0.0), at(k + 1.0, 0.0), diagonal(1e-6, 0.0), 10.0);
  EXPECT_NEAR(turning.covariance()(2, 2), 3e-6, 1e-15);
  EXPECT_NEAR(turning.covariance()(0, 0) + turning.covariance()(1, 1), 0.0, 1e-20);
}

TEST(MapDrift, PropagationIsThatOfSampledPoses) {
  // Poses with a random heading error that drive on by dead reckoning: their spread is the propagated one.
  MapDrift drift(1.0);
  drift.advance(at(0.0, 0.0), at(1.0, 0.0), diagonal(4e-4, 0.0), 1.0);
  const double variance = drift.covariance()(2, 2);
  drift.advance(at(1.0, 0.0), at(21.0, 0.7), Matrix6d::Zero(), 1.0);
  std::mt19937 generator(2);
  std::normal_distribution<double> normal(0.0, std::sqrt(variance));
  double sum = 0.0;
  constexpr int kSamples = 20000;
  for (int k = 0; k < kSamples; ++k) sum += std::pow(20.0 * std::sin(normal(generator)), 2);
  EXPECT_NEAR(drift.covariance()(4, 4), sum / kSamples, 0.05 * sum / kSamples);
}

}  // namespace
}  // namespace fdi_lio::odometry
