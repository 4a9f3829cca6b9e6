#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include "fdi_lio/ros/odometry_message.hpp"

namespace fdi_lio::ros_bridge {
namespace {

constexpr Stamp kStamp = 1321000000123456789;

class Conversions : public testing::Test {
 protected:
  double number() { return distribution_(engine_); }
  Eigen::Vector3d vector() { return {number(), number(), number()}; }
  Eigen::Quaterniond rotation() {
    return Eigen::Quaterniond(number(), number(), number(), number()).normalized();
  }
  template <typename Matrix>
  void randomise(Matrix* matrix) {
    *matrix = Matrix::NullaryExpr([this]() { return number(); });
  }
  std::vector<Point> points(std::size_t count) {
    std::vector<Point> result(count);
    for (Point& point : result) {
      point.position = vector().cast<float>();
      point.intensity = static_cast<float>(number());
      point.time_s = static_cast<float>(number());
      point.ring = static_cast<std::uint16_t>(engine_());
      point.column = static_cast<std::uint16_t>(engine_());
    }
    return result;
  }

 private:
  std::mt19937 engine_{5};
  std::normal_distribution<double> distribution_;
};

void expect_equal(const std::vector<Point>& a, const std::vector<Point>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].position, b[i].position);
    EXPECT_EQ(a[i].intensity, b[i].intensity);
    EXPECT_EQ(a[i].time_s, b[i].time_s);
    EXPECT_EQ(a[i].ring, b[i].ring);
    EXPECT_EQ(a[i].column, b[i].column);
  }
}

TEST_F(Conversions, AScanKeepsEveryBit) {
  DeskewedScan scan;
  scan.stamp = kStamp;
  scan.duration_s = 0.0997;
  scan.points = points(10);
  scan.ring_begin = {0, 4, 10};
  scan.has_intensity = true;
  scan.intensity_gradient.assign(10, 0.25F);
  scan.removed = points(3);
  scan.sweep.start = Eigen::Vector3f(1.0F, -2.0F, 0.5F);
  for (std::size_t k = 0; k < scan.sweep.axes.size(); ++k)
    scan.sweep.axes[k] = Eigen::Vector3f(0.01F * static_cast<float>(k), 0.02F, 0.999F);
  const DeskewedScan back = to_scan(*to_message(scan, "lidar"));
  EXPECT_EQ(back.stamp, scan.stamp);
  EXPECT_EQ(back.duration_s, scan.duration_s);
  EXPECT_EQ(back.ring_begin, scan.ring_begin);
  EXPECT_EQ(back.has_intensity, scan.has_intensity);
  EXPECT_EQ(back.intensity_gradient, scan.intensity_gradient);
  expect_equal(back.points, scan.points);
  expect_equal(back.removed, scan.removed);
  EXPECT_EQ(back.sweep.start, scan.sweep.start);
  EXPECT_EQ(back.sweep.axes, scan.sweep.axes);
}

TEST_F(Conversions, FeaturesKeepEveryBit) {
  FeatureSet features;
  features.stamp = kStamp;
  features.planes = points(5);
  features.plane_scores = {1, 2, 3, 4, 5};
  features.edges = points(2);
  features.edge_scores = {0.5F, 0.25F};
  features.intensity_edges = points(1);
  features.intensity_scores = {0.125F};
  const FeatureSet back = to_features(*to_message(features, "lidar"));
  EXPECT_EQ(back.stamp, features.stamp);
  expect_equal(back.planes, features.planes);
  expect_equal(back.edges, features.edges);
  expect_equal(back.intensity_edges, features.intensity_edges);
  EXPECT_EQ(back.plane_scores, features.plane_scores);
  EXPECT_EQ(back.edge_scores, features.edge_scores);
  EXPECT_EQ(back.intensity_scores, features.intensity_scores);
}

TEST_F(Conversions, ArraysOfWrongLengthAreNamed) {
  DeskewedScan scan;
  scan.points = points(10);
  scan.ring_begin = {0, 10};
  DeskewedCloud message = *to_message(scan, "lidar");
  message.intensity_gradient.resize(7);
  EXPECT_THROW(to_scan(message), Error);
  message.intensity_gradient.clear();
  message.points.data.pop_back();
  EXPECT_THROW(to_scan(message), Error);
}

TEST_F(Conversions, RingsThatLeadOutOfTheScanAreRefused) {
  DeskewedScan scan;
  scan.points = points(10);
  scan.ring_begin = {0, 11};
  EXPECT_THROW(to_scan(*to_message(scan, "lidar")), Error);
}

TEST_F(Conversions, DegeneracyKeepsEveryBit) {
  degeneracy::Degeneracy degeneracy;
  degeneracy.stamp = kStamp;
  degeneracy.fdi = number();
  degeneracy.sub_factors = {number(), number(), number()};
  degeneracy.weights = {number(), number(), number()};
  degeneracy.metrics = {number(), number(), number(), number(), true,    number(),
                        number(), 7U,       true,     number(), number()};
  degeneracy.environment = degeneracy::EnvironmentClass::kMixed;
  randomise(&degeneracy.axes);
  randomise(&degeneracy.localizability);
  const degeneracy::Degeneracy back = to_degeneracy(*to_message(degeneracy, "imu"));
  EXPECT_EQ(back.stamp, degeneracy.stamp);
  EXPECT_EQ(back.fdi, degeneracy.fdi);
  EXPECT_EQ(back.sub_factors, degeneracy.sub_factors);
  EXPECT_EQ(back.weights, degeneracy.weights);
  EXPECT_EQ(back.metrics.geometric_complexity, degeneracy.metrics.geometric_complexity);
  EXPECT_EQ(back.metrics.curvature_complexity, degeneracy.metrics.curvature_complexity);
  EXPECT_EQ(back.metrics.point_entropy, degeneracy.metrics.point_entropy);
  EXPECT_EQ(back.metrics.plane_deviation_m, degeneracy.metrics.plane_deviation_m);
  EXPECT_EQ(back.metrics.has_gradient, degeneracy.metrics.has_gradient);
  EXPECT_EQ(back.metrics.gradient_mean, degeneracy.metrics.gradient_mean);
  EXPECT_EQ(back.metrics.gradient_variation, degeneracy.metrics.gradient_variation);
  EXPECT_EQ(back.metrics.has_moving_share, degeneracy.metrics.has_moving_share);
  EXPECT_EQ(back.metrics.moving_share, degeneracy.metrics.moving_share);
  EXPECT_EQ(back.metrics.points, degeneracy.metrics.points);
  EXPECT_EQ(back.metrics.position_sigma_m, degeneracy.metrics.position_sigma_m);
  EXPECT_EQ(back.environment, degeneracy.environment);
  EXPECT_EQ(back.axes, degeneracy.axes);
  EXPECT_EQ(back.localizability, degeneracy.localizability);
}

TEST_F(Conversions, StatusAndStateKeepEveryBit) {
  odometry::EstimateResult estimate;
  estimate.status.stamp = kStamp;
  randomise(&estimate.status.axes);
  randomise(&estimate.status.localizability);
  estimate.status.residual_rms_m = number();
  estimate.covariance.diagonal() << 1.0, 1.0, 1.0, 1e-4, 9e-4, 4e-4;
  estimate.status.iterations = 3;
  estimate.status.matched = 4;
  imu::NavState& state = estimate.state;
  state.stamp = kStamp;
  state.q_odom_imu = rotation();
  state.t_odom_imu = vector();
  state.v_odom = vector();
  state.gyro_bias = vector();
  state.accel_bias = vector();
  randomise(&state.gyro_scale);
  state.mounting = vector();
  state.lidar_time_offset_s = number();
  state.g_odom = vector();
  state.w_imu = vector();
  state.imu_status = imu::ImuStatus::kInitialising;
  const degeneracy::OptimisationStatus status = to_status(*to_status_message(estimate, "imu"));
  EXPECT_EQ(status.stamp, kStamp);
  EXPECT_EQ(status.axes, estimate.status.axes);
  EXPECT_EQ(status.localizability, estimate.status.localizability);
  EXPECT_EQ(status.residual_rms_m, estimate.status.residual_rms_m);
  EXPECT_EQ(status.position_sigma_m, degeneracy::weakest_position_sigma_m(estimate.map_covariance));
  EXPECT_EQ(status.iterations, 3U);
  EXPECT_EQ(status.matched, 4U);
  const EstimatorStatePtr message = to_state_message(estimate, kStamp + 5, "odom", "imu");
  EXPECT_EQ(to_stamp(message->answers), kStamp + 5);
  const imu::NavState back = to_state(*message);
  EXPECT_EQ(back.stamp, state.stamp);
  EXPECT_EQ(back.q_odom_imu.coeffs(), state.q_odom_imu.coeffs());
  EXPECT_EQ(back.t_odom_imu, state.t_odom_imu);
  EXPECT_EQ(back.v_odom, state.v_odom);
  EXPECT_EQ(back.gyro_bias, state.gyro_bias);
  EXPECT_EQ(back.accel_bias, state.accel_bias);
  EXPECT_EQ(back.gyro_scale, state.gyro_scale);
  EXPECT_EQ(back.mounting, state.mounting);
  EXPECT_EQ(back.lidar_time_offset_s, state.lidar_time_offset_s);
  EXPECT_EQ(back.g_odom, state.g_odom);
  EXPECT_EQ(back.w_imu, state.w_imu);
  EXPECT_EQ(back.imu_status, state.imu_status);
}

TEST_F(Conversions, PreintegrationKeepsEveryBit) {
  imu::Preintegration p;
  p.from = kStamp;
  p.to = kStamp + 100000000;
  p.delta_q = rotation();
  p.delta_v = vector();
  p.delta_p = vector();
  randomise(&p.covariance);
  p.lidar_time_offset_s = number();
  p.dq_doffset = vector();
  p.gyro_bias = vector();
  p.accel_bias = vector();
  randomise(&p.gyro_scale);
  for (Eigen::Matrix3d* jacobian : {&p.dq_dbg, &p.dv_dbg, &p.dv_dba, &p.dp_dbg, &p.dp_dba})
    randomise(jacobian);
  p.sample_count = 11;
  p.longest_gap_s = number();
  p.last_angular_velocity = vector();
  p.recent = {number(), 7, vector(), vector(), number(), number(), number(), number()};
  const imu::Preintegration back = to_preintegration(*to_message(p, "imu"));
  EXPECT_EQ(back.from, p.from);
  EXPECT_EQ(back.to, p.to);
  EXPECT_EQ(back.delta_q.coeffs(), p.delta_q.coeffs());
  EXPECT_EQ(back.delta_v, p.delta_v);
  EXPECT_EQ(back.delta_p, p.delta_p);
  EXPECT_EQ(back.covariance, p.covariance);
  EXPECT_EQ(back.gyro_bias, p.gyro_bias);
  EXPECT_EQ(back.accel_bias, p.accel_bias);
  EXPECT_EQ(back.gyro_scale, p.gyro_scale);
  EXPECT_EQ(back.dq_dbg, p.dq_dbg);
  EXPECT_EQ(back.dv_dbg, p.dv_dbg);
  EXPECT_EQ(back.dv_dba, p.dv_dba);
  EXPECT_EQ(back.dp_dbg, p.dp_dbg);
  EXPECT_EQ(back.dp_dba, p.dp_dba);
  EXPECT_EQ(back.dq_doffset, p.dq_doffset);
  EXPECT_EQ(back.lidar_time_offset_s, p.lidar_time_offset_s);
  EXPECT_EQ(back.sample_count, p.sample_count);
  EXPECT_EQ(back.longest_gap_s, p.longest_gap_s);
  EXPECT_EQ(back.last_angular_velocity, p.last_angular_velocity);
  EXPECT_EQ(back.recent.duration_s, p.recent.duration_s);
  EXPECT_EQ(back.recent.count, p.recent.count);
  EXPECT_EQ(back.recent.mean_acceleration, p.recent.mean_acceleration);
  EXPECT_EQ(back.recent.mean_angular_velocity, p.recent.mean_angular_velocity);
  EXPECT_EQ(back.recent.acceleration_std, p.recent.acceleration_std);
  EXPECT_EQ(back.recent.angular_velocity_std, p.recent.angular_velocity_std);
  EXPECT_EQ(back.recent.acceleration_noise, p.recent.acceleration_noise);
  EXPECT_EQ(back.recent.angular_velocity_noise, p.recent.angular_velocity_noise);
}

TEST_F(Conversions, OdometryIsThatOfTheBase) {
  imu::NavState state;
  state.stamp = kStamp;
  state.q_odom_imu = rotation();
  state.t_odom_imu = vector();
  state.v_odom = vector();
  state.w_imu = vector();
  Eigen::Isometry3d T_base_imu = Eigen::Isometry3d::Identity();
  T_base_imu.linear() = rotation().toRotationMatrix();
  T_base_imu.translation() = vector();
  boost::array<double, 36> covariance{};
  boost::array<double, 9> velocity_covariance{};
  Eigen::Matrix<double, 6, 6, Eigen::RowMajor> root;
  randomise(&root);
  const Eigen::Matrix<double, 6, 6, Eigen::RowMajor> pose_covariance = root * root.transpose();
  std::copy(pose_covariance.data(), pose_covariance.data() + 36, covariance.begin());
  const FrameConfig frames;
  const auto odometry = [&](const imu::NavState& at) {
    return to_odometry(at, T_base_imu, covariance, velocity_covariance, SensorConfig(), frames);
  };
  const nav_msgs::Odometry message = odometry(state);
  const auto T_of = [](const nav_msgs::Odometry& m) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = Eigen::Quaterniond(m.pose.pose.orientation.w, m.pose.pose.orientation.x,
                                    m.pose.pose.orientation.y, m.pose.pose.orientation.z)
                     .toRotationMatrix();
    T.translation() << m.pose.pose.position.x, m.pose.pose.position.y, m.pose.pose.position.z;
    return T;
  };
  const Eigen::Isometry3d T = T_of(message);
  EXPECT_TRUE(T.isApprox(state.T_odom_imu() * T_base_imu.inverse(), 1e-12));

  // The twist against the difference of two poses.
  constexpr double kStep = 1e-6;
  imu::NavState later = state;
  later.q_odom_imu = state.q_odom_imu * so3::exp(Eigen::Vector3d(state.w_imu * kStep));
  later.t_odom_imu += state.v_odom * kStep;
  const Eigen::Isometry3d change = T.inverse() * T_of(odometry(later));
  const Eigen::Vector3d linear(message.twist.twist.linear.x, message.twist.twist.linear.y,
                               message.twist.twist.linear.z);
  const Eigen::Vector3d angular(message.twist.twist.angular.x, message.twist.twist.angular.y,
                                message.twist.twist.angular.z);
  EXPECT_LT((change.translation() / kStep - linear).norm(), 1e-4);
  EXPECT_LT((so3::log(Eigen::Matrix3d(change.rotation())) / kStep - angular).norm(), 1e-4);

  // The covariance against numeric Jacobians.
  Eigen::Matrix<double, 6, 6> jacobian;
  for (int k = 0; k < 6; ++k) {
    imu::NavState moved = state;
    Eigen::Matrix<double, 6, 1> delta = Eigen::Matrix<double, 6, 1>::Zero();
    delta[k] = kStep;
    moved.q_odom_imu = state.q_odom_imu * so3::exp(Eigen::Vector3d(delta.head<3>()));
    moved.t_odom_imu += delta.tail<3>();
    const Eigen::Isometry3d T_moved = T_of(odometry(moved));
    jacobian.block<3, 1>(0, k) = (T_moved.translation() - T.translation()) / kStep;
    jacobian.block<3, 1>(3, k) =
        so3::log(Eigen::Matrix3d(T_moved.rotation() * T.rotation().transpose())) / kStep;
  }
  const Eigen::Matrix<double, 6, 6> expected = jacobian * pose_covariance * jacobian.transpose();
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column)
      EXPECT_NEAR(message.pose.covariance[static_cast<std::size_t>(6 * row + column)], expected(row, column),
                  1e-3 * expected.norm());
  }
}

}  // namespace
}  // namespace fdi_lio::ros_bridge
