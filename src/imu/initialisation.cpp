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

/// Whether readings scatter by no more than `usual`, or than the vibration explains that is seen in them.
bool is_scatter_of_rest(double deviation, double usual, double noise_density, double rate_hz) {
  constexpr double kChance = 1.2;  // of a hundred readings, in two estimates of their deviation
  return deviation < std::hypot(usual, kChance * noise_density * std::sqrt(3.0 * rate_hz));
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
  return is_long_enough(statistics, config) && is_calm(statistics, config);
}

bool is_long_enough(const ImuStatistics& statistics, const ImuConfig& config) {
  return statistics.duration_s >= 0.9 * config.static_duration_s;
}

bool is_calm(const ImuStatistics& statistics, const ImuConfig& config) {
  const double rate_hz = (statistics.count - 1) / std::max(statistics.duration_s, 1e-3);
  return is_scatter_of_rest(statistics.angular_velocity_std, config.static_gyro_std,
                            statistics.angular_velocity_noise, rate_hz) &&
         is_scatter_of_rest(statistics.acceleration_std, config.static_accel_std,
                            statistics.acceleration_noise, rate_hz) &&
         statistics.mean_angular_velocity.norm() < config.static_max_rate;
}

std::optional<AlignmentResult> align_in_motion(const Eigen::Quaterniond& first_q,
                                               const Eigen::Vector3d& first_t,
                                               const std::vector<AlignmentInterval>& intervals,
                                               double gravity_mps2) {
  if (intervals.size() < kMinIntervals) return std::nullopt;
  const Eigen::Vector3d bias_change = estimate_gyro_bias(first_q, intervals);
  // Position and velocity by the accelerometer alone: without gravity, from rest at the origin.
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q = first_q;
  double time_s = 0.0;
  const auto count = static_cast<Eigen::Index>(intervals.size()) + 1;
  Eigen::MatrixXd A = Eigen::MatrixXd::Ones(count, 3);  // of p0, v0 and g; each axis by itself
  Eigen::MatrixXd z(count, 3);
  A.block<1, 2>(0, 1).setZero();
  z.row(0) = first_t.transpose();
  for (Eigen::Index k = 1; k < count; ++k) {
    const AlignmentInterval& interval = intervals[static_cast<std::size_t>(k - 1)];
    const double dt = interval.imu.duration_s();
    ImuErrors errors = interval.imu.errors();
    errors.gyro_bias += bias_change;
    const CorrectedDelta delta = corrected(interval.imu, errors);
    p += v * dt + q * delta.delta_p;
    v += q * delta.delta_v;
    time_s += dt;
    A(k, 1) = time_s;
    A(k, 2) = 0.5 * time_s * time_s;
    z.row(k) = (interval.t_odom_imu - p).transpose();
    q = interval.q_odom_imu;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(A.transpose() * A);
  if (solver.info() != Eigen::Success || solver.vectorD().minCoeff() < 1e-12) return std::nullopt;
  const Eigen::Matrix3d x = solver.solve(A.transpose() * z);
  const Eigen::Matrix3d inverse = solver.solve(Eigen::Matrix3d::Identity());
  const Eigen::RowVector3d variance =
      (z - A * x).colwise().squaredNorm() / static_cast<double>(count - x.rows());
  AlignmentResult result;
  result.gyro_bias = intervals.back().imu.gyro_bias + bias_change;
  result.g_odom = x.row(2).transpose();
  result.v_first = x.row(1).transpose();
  result.v_odom = result.v_first + result.g_odom * time_s + v;
  result.gravity_sigma_mps2 = std::sqrt(inverse(2, 2) * variance.maxCoeff());
  result.gravity_error_mps2 = std::abs(result.g_odom.norm() - gravity_mps2);
  const Eigen::Vector3d felt_g_odom = result.g_odom;
  result.g_odom *= gravity_mps2 / result.g_odom.norm();
  result.accel_bias = intervals.back().imu.accel_bias +
                      intervals.back().q_odom_imu.conjugate() * (result.g_odom - felt_g_odom);
  return result;
}

}  // namespace fdi_lio::imu
