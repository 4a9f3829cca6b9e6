#include "fdi_lio/imu/initialisation.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::imu {

namespace {

constexpr std::size_t kMinIntervals = 5;

/// Gyro bias by one Gauss-Newton step on the rotation residuals; they are linear to well below a milliradian.
Eigen::Vector3d estimate_gyro_bias(const Eigen::Quaterniond& first_q,
                                   const std::vector<AlignmentInterval>& intervals) {
  Eigen::Matrix3d H = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_before = first_q;
  for (const AlignmentInterval& interval : intervals) {
    const Eigen::Vector3d error = so3::log(
        Eigen::Quaterniond(interval.imu.delta_q.conjugate() * q_before.conjugate() * interval.q_odom_imu));
    H += interval.imu.dq_dbg.transpose() * interval.imu.dq_dbg;
    b += interval.imu.dq_dbg.transpose() * error;
    q_before = interval.q_odom_imu;
  }
  return H.ldlt().solve(b);
}

}  // namespace

Eigen::Quaterniond level_orientation(const ImuStatistics& statistics) {
  if (statistics.count == 0 || statistics.mean_acceleration.norm() < 1.0)
    return Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond tilt =
      Eigen::Quaterniond::FromTwoVectors(statistics.mean_acceleration, Eigen::Vector3d::UnitZ());
  const Eigen::Matrix3d R = tilt.toRotationMatrix();
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  return (Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()) * tilt).normalized();
}

bool is_static(const ImuStatistics& statistics, const ImuConfig& config) {
  return statistics.duration_s >= 0.9 * config.static_duration_s &&
         statistics.angular_velocity_std < config.static_gyro_std &&
         statistics.acceleration_std < config.static_accel_std &&
         statistics.mean_angular_velocity.norm() < config.static_max_rate;
}

std::optional<AlignmentResult> align_in_motion(const Eigen::Quaterniond& first_q,
                                               const Eigen::Vector3d& first_t,
                                               const std::vector<AlignmentInterval>& intervals,
                                               double gravity_mps2) {
  if (intervals.size() < kMinIntervals) return std::nullopt;
  AlignmentResult result;
  const Eigen::Vector3d bias_change = estimate_gyro_bias(first_q, intervals);
  const Eigen::Index unknowns = static_cast<Eigen::Index>(3 * (intervals.size() + 1) + 3);
  const Eigen::Index g = unknowns - 3;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(unknowns, unknowns);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(unknowns);
  Eigen::Quaterniond q = first_q;
  Eigen::Vector3d t = first_t;
  for (std::size_t k = 0; k < intervals.size(); ++k) {
    const AlignmentInterval& interval = intervals[k];
    const double dt = interval.imu.duration_s();
    const CorrectedDelta delta =
        corrected(interval.imu, interval.imu.gyro_bias + bias_change, interval.imu.accel_bias);
    const Eigen::Index vi = static_cast<Eigen::Index>(3 * k);
    Eigen::MatrixXd A = Eigen::MatrixXd::Zero(6, unknowns);
    Eigen::Matrix<double, 6, 1> z;
    A.block<3, 3>(0, vi) = dt * Eigen::Matrix3d::Identity();
    A.block<3, 3>(0, g) = 0.5 * dt * dt * Eigen::Matrix3d::Identity();
    z.head<3>() = interval.t_odom_imu - t - q * delta.delta_p;
    A.block<3, 3>(3, vi) = -Eigen::Matrix3d::Identity();
    A.block<3, 3>(3, vi + 3) = Eigen::Matrix3d::Identity();
    A.block<3, 3>(3, g) = -dt * Eigen::Matrix3d::Identity();
    z.tail<3>() = q * delta.delta_v;
    // A lidar position is good to about a centimetre, an IMU velocity change to about a centimetre per
    // second.
    H += A.transpose() * A;
    b += A.transpose() * z;
    q = interval.q_odom_imu;
    t = interval.t_odom_imu;
    if (k + 1 == intervals.size()) result.gyro_bias = interval.imu.gyro_bias + bias_change;
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(H);
  if (solver.info() != Eigen::Success || solver.vectorD().minCoeff() < 1e-12) return std::nullopt;
  const Eigen::VectorXd x = solver.solve(b);
  result.g_odom = x.segment<3>(g);
  result.v_odom = x.segment<3>(g - 3);
  result.gravity_error_mps2 = std::abs(result.g_odom.norm() - gravity_mps2);
  result.g_odom *= gravity_mps2 / result.g_odom.norm();
  return result;
}

}  // namespace fdi_lio::imu
