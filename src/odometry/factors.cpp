#include "fdi_lio/odometry/factors.hpp"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr double kGravitySigma =
    1e-3;  ///< latitude and height are worth more, but they are constant: 1 mm/s^2

constexpr int kTheta = 0;
constexpr int kPosition = 3;
constexpr int kVelocity = 6;
constexpr int kGyroBias = 9;
constexpr int kAccelBias = 12;
constexpr int kGravity = 0;
constexpr int kMounting = 3;
constexpr int kBeamElevation = 6;
constexpr int kTimeOffset = 7;
constexpr int kGyroScale = 8;         ///< column by column
constexpr double kLeastRadius = 1.0;  ///< of the features [m]

using Vector3Map = Eigen::Map<const Eigen::Vector3d>;
using Matrix3Map = Eigen::Map<const Eigen::Matrix3d>;
template <int Rows, int Columns>
using RowMajor = Eigen::Matrix<double, Rows, Columns, Eigen::RowMajor>;

}  // namespace

imu::NavState apply(const imu::NavState& state, const double* delta_state, const double* delta_shared) {
  imu::NavState moved = state;
  moved.q_odom_imu = (state.q_odom_imu * so3::exp_q(Vector3Map(delta_state + kTheta))).normalized();
  moved.t_odom_imu += Vector3Map(delta_state + kPosition);
  moved.v_odom += Vector3Map(delta_state + kVelocity);
  moved.gyro_bias += Vector3Map(delta_state + kGyroBias);
  moved.accel_bias += Vector3Map(delta_state + kAccelBias);
  moved.g_odom += Vector3Map(delta_shared + kGravity);
  moved.mounting += Vector3Map(delta_shared + kMounting);
  moved.beam_elevation += delta_shared[kBeamElevation];
  moved.lidar_time_offset_s += delta_shared[kTimeOffset];
  moved.gyro_scale += Matrix3Map(delta_shared + kGyroScale);
  return moved;
}

MotionCost::MotionCost(const imu::NavState& nominal_i, const imu::NavState& nominal_j,
                       const imu::Preintegration& preintegration, bool with_gravity,
                       const Eigen::Vector3d& bend)
    : nominal_i_(nominal_i),
      nominal_j_(nominal_j),
      preintegration_(preintegration),
      with_gravity_(with_gravity),
      bend_(bend) {
  // Order of the residual is that of the covariance: [dtheta, dp, dv, db_g, db_a]. Position and velocity of a
  // single short step are fully correlated, hence the floor.
  Matrix15d covariance = preintegration.covariance;
  covariance.diagonal().array() += 1e-12;
  const Matrix15d information = covariance.llt().solve(Matrix15d::Identity());
  sqrt_information_ = (0.5 * (information + information.transpose())).llt().matrixU();
}

bool MotionCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  imu::NavState i = apply(nominal_i_, parameters[0], parameters[2]);
  imu::NavState j = apply(nominal_j_, parameters[1], parameters[2]);
  const Eigen::Quaterniond q_pose_imu =
      with_gravity_ ? so3::exp_q(i.mounting) : Eigen::Quaterniond::Identity();
  i.q_odom_imu = i.q_odom_imu * q_pose_imu;
  j.q_odom_imu = j.q_odom_imu * q_pose_imu;
  const double dt = preintegration_.duration_s();
  const imu::CorrectedDelta delta = imu::corrected(preintegration_, i.errors());
  const Eigen::Vector3d g = with_gravity_ ? i.g_odom : Eigen::Vector3d::Zero();
  const Eigen::Matrix3d Ri_T = i.q_odom_imu.toRotationMatrix().transpose();
  const Eigen::Vector3d turn = -i.beam_elevation * bend_;
  const Eigen::Matrix3d E = so3::exp(turn);
  const Eigen::Matrix3d half_E = so3::exp(Eigen::Vector3d(0.5 * turn));
  const Eigen::Vector3d v_j = Ri_T * j.v_odom;
  const Eigen::Vector3d v_fallen = Ri_T * (i.v_odom + dt * g);
  const Eigen::Vector3d step = Ri_T * (j.t_odom_imu - i.t_odom_imu);
  const Eigen::Vector3d step_fallen = Ri_T * (dt * i.v_odom + 0.5 * dt * dt * g);
  const Eigen::Vector3d dv = E * v_j - v_fallen;
  const Eigen::Vector3d dp = half_E * step - step_fallen;

  Vector15d r;
  const Eigen::Vector3d r_theta = so3::log(Eigen::Quaterniond(delta.delta_q.conjugate() * so3::exp_q(turn) *
                                                              i.q_odom_imu.conjugate() * j.q_odom_imu));
  r.segment<3>(kTheta) = r_theta;
  r.segment<3>(kPosition) = dp - delta.delta_p;
  r.segment<3>(kVelocity) = dv - delta.delta_v;
  r.segment<3>(kGyroBias) = j.gyro_bias - i.gyro_bias;
  r.segment<3>(kAccelBias) = j.accel_bias - i.accel_bias;
  Eigen::Map<Vector15d>{residuals} = sqrt_information_ * r;
  if (jacobians == nullptr) return true;

  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d jr_inv = so3::right_jacobian_inverse(r_theta);
  // The block is the perturbation itself: R = R0 Exp(dtheta) Exp(mounting), whose derivative away from zero
  // carries Jr(dtheta), turned into the axes of the IMU.
  const Eigen::Matrix3d R_imu_pose = q_pose_imu.toRotationMatrix().transpose();
  const Eigen::Matrix3d jr_i = R_imu_pose * so3::right_jacobian(Vector3Map(parameters[0]));
  const Eigen::Matrix3d jr_j = R_imu_pose * so3::right_jacobian(Vector3Map(parameters[1]));
  const Eigen::Matrix3d Rj_T_Ri = (j.q_odom_imu.conjugate() * i.q_odom_imu).toRotationMatrix();
  const Eigen::Matrix3d dp_dtheta = half_E * so3::hat(step) - so3::hat(step_fallen);
  const Eigen::Matrix3d dv_dtheta = E * so3::hat(v_j) - so3::hat(v_fallen);
  // Of r_theta with respect to the vector by whose exponential `delta` is corrected.
  const Eigen::Vector3d mean_reading = imu::mean_reading(preintegration_);
  const Eigen::Vector3d correction =
      preintegration_.dq_dbg * (i.gyro_bias - preintegration_.gyro_bias +
                                (i.gyro_scale - preintegration_.gyro_scale) * mean_reading) +
      (i.lidar_time_offset_s - preintegration_.lidar_time_offset_s) * preintegration_.dq_doffset;
  const Eigen::Matrix3d dr_dcorrection =
      -jr_inv * so3::exp(r_theta).transpose() * so3::right_jacobian(correction);
  if (jacobians[0] != nullptr) {
    Matrix15d J = Matrix15d::Zero();
    J.block<3, 3>(kTheta, kTheta) = -jr_inv * Rj_T_Ri * jr_i;
    J.block<3, 3>(kTheta, kGyroBias) = dr_dcorrection * preintegration_.dq_dbg;
    J.block<3, 3>(kPosition, kTheta) = dp_dtheta * jr_i;
    J.block<3, 3>(kPosition, kPosition) = -half_E * Ri_T;
    J.block<3, 3>(kPosition, kVelocity) = -dt * Ri_T;
    J.block<3, 3>(kPosition, kGyroBias) = -preintegration_.dp_dbg;
    J.block<3, 3>(kPosition, kAccelBias) = -preintegration_.dp_dba;
    J.block<3, 3>(kVelocity, kTheta) = dv_dtheta * jr_i;
    J.block<3, 3>(kVelocity, kVelocity) = -Ri_T;
    J.block<3, 3>(kVelocity, kGyroBias) = -preintegration_.dv_dbg;
    J.block<3, 3>(kVelocity, kAccelBias) = -preintegration_.dv_dba;
    J.block<3, 3>(kGyroBias, kGyroBias) = -I;
    J.block<3, 3>(kAccelBias, kAccelBias) = -I;
    Eigen::Map<RowMajor<15, 15>>{jacobians[0]} = sqrt_information_ * J;
  }
  if (jacobians[1] != nullptr) {
    Matrix15d J = Matrix15d::Zero();
    J.block<3, 3>(kTheta, kTheta) = jr_inv * jr_j;
    J.block<3, 3>(kPosition, kPosition) = half_E * Ri_T;
    J.block<3, 3>(kVelocity, kVelocity) = E * Ri_T;
    J.block<3, 3>(kGyroBias, kGyroBias) = I;
    J.block<3, 3>(kAccelBias, kAccelBias) = I;
    Eigen::Map<RowMajor<15, 15>>{jacobians[1]} = sqrt_information_ * J;
  }
  if (jacobians[2] != nullptr) {
    Eigen::Matrix<double, 15, kSharedSize> J = Eigen::Matrix<double, 15, kSharedSize>::Zero();
    if (with_gravity_) {
      const Eigen::Matrix3d jr_mounting = so3::right_jacobian(i.mounting);
      J.block<3, 3>(kPosition, kGravity) = -0.5 * dt * dt * Ri_T;
      J.block<3, 3>(kVelocity, kGravity) = -dt * Ri_T;
      J.block<3, 3>(kTheta, kMounting) = jr_inv * (I - Rj_T_Ri) * jr_mounting;
      J.block<3, 3>(kPosition, kMounting) = dp_dtheta * jr_mounting;
      J.block<3, 3>(kVelocity, kMounting) = dv_dtheta * jr_mounting;
    }
    // The turn is always about the same axis, whose derivatives need no Jacobian of the rotation group.
    J.block<3, 1>(kTheta, kBeamElevation) = -jr_inv * Rj_T_Ri * bend_;
    J.block<3, 1>(kPosition, kBeamElevation) = -0.5 * bend_.cross(half_E * step);
    J.block<3, 1>(kVelocity, kBeamElevation) = -bend_.cross(E * v_j);
    J.block<3, 1>(kTheta, kTimeOffset) = dr_dcorrection * preintegration_.dq_doffset;
    for (int axis = 0; axis < 3; ++axis) {
      const int column = kGyroScale + 3 * axis;
      J.block<3, 3>(kTheta, column) = mean_reading[axis] * dr_dcorrection * preintegration_.dq_dbg;
      J.block<3, 3>(kPosition, column) = -mean_reading[axis] * preintegration_.dp_dbg;
      J.block<3, 3>(kVelocity, column) = -mean_reading[axis] * preintegration_.dv_dbg;
    }
    Eigen::Map<RowMajor<15, kSharedSize>>{jacobians[2]} = sqrt_information_ * J;
  }
  return true;
}

LidarCost::LidarCost(const imu::NavState& nominal, const matching::LidarInformation& information)
    : nominal_(nominal), information_(information) {
  Eigen::MatrixXd A;
  Eigen::VectorXd e;
  factorise(information.H, information.b, 1e-12, &A, &e);
  sqrt_information_ = A;
  offset_ = e;
}

bool LidarCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Vector3Map dtheta(parameters[0] + kTheta);
  const Eigen::Quaterniond q = nominal_.q_odom_imu * so3::exp_q(dtheta);
  Vector6d d;
  d.head<3>() = so3::log(Eigen::Quaterniond(information_.q_odom_imu.conjugate() * q));
  d.tail<3>() = nominal_.t_odom_imu + Vector3Map(parameters[0] + kPosition) - information_.t_odom_imu;
  Eigen::Map<Vector6d>{residuals} = sqrt_information_ * d + offset_;
  if (jacobians == nullptr || jacobians[0] == nullptr) return true;
  Eigen::Matrix<double, 6, 15> J = Eigen::Matrix<double, 6, 15>::Zero();
  J.block<3, 3>(0, kTheta) =
      so3::right_jacobian_inverse(d.head<3>()) * so3::right_jacobian(Eigen::Vector3d(dtheta));
  J.block<3, 3>(3, kPosition).setIdentity();
  Eigen::Map<RowMajor<6, 15>>{jacobians[0]} = sqrt_information_ * J;
  return true;
}

PriorCost::PriorCost(const imu::NavState& nominal, const StatePrior& prior)
    : nominal_(nominal), prior_(prior) {}

bool PriorCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const imu::NavState state = apply(nominal_, parameters[0], parameters[1]);
  const imu::NavState& origin = prior_.linearisation;
  PriorVector d;
  d.segment<3>(kTheta) = so3::log(Eigen::Quaterniond(origin.q_odom_imu.conjugate() * state.q_odom_imu));
  d.segment<3>(kPosition) = state.t_odom_imu - origin.t_odom_imu;
  d.segment<3>(kVelocity) = state.v_odom - origin.v_odom;
  d.segment<3>(kGyroBias) = state.gyro_bias - origin.gyro_bias;
  d.segment<3>(kAccelBias) = state.accel_bias - origin.accel_bias;
  d.segment<3>(kStateSize + kGravity) = state.g_odom - origin.g_odom;
  d.segment<3>(kStateSize + kMounting) = state.mounting - origin.mounting;
  d[kStateSize + kBeamElevation] = state.beam_elevation - origin.beam_elevation;
  d[kStateSize + kTimeOffset] = state.lidar_time_offset_s - origin.lidar_time_offset_s;
  Eigen::Map<Eigen::Matrix3d>(d.data() + kStateSize + kGyroScale) = state.gyro_scale - origin.gyro_scale;
  Eigen::Map<PriorVector>{residuals} = prior_.sqrt_information * d + prior_.offset;
  if (jacobians == nullptr) return true;
  if (jacobians[0] != nullptr) {
    Eigen::Matrix<double, kPriorSize, kStateSize> J = Eigen::Matrix<double, kPriorSize, kStateSize>::Zero();
    J.topRows<kStateSize>().setIdentity();
    J.block<3, 3>(kTheta, kTheta) =
        so3::right_jacobian_inverse(d.head<3>()) * so3::right_jacobian(Vector3Map(parameters[0]));
    Eigen::Map<RowMajor<kPriorSize, kStateSize>>{jacobians[0]} = prior_.sqrt_information * J;
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<RowMajor<kPriorSize, kSharedSize>>{jacobians[1]} =
        prior_.sqrt_information.rightCols<kSharedSize>();
  }
  return true;
}

GravityNormCost::GravityNormCost(const imu::NavState& nominal, double magnitude_mps2)
    : g_odom_(nominal.g_odom), magnitude_(magnitude_mps2) {}

bool GravityNormCost::Evaluate(double const* const* parameters, double* residuals, double** jacobians) const {
  const Eigen::Vector3d g = g_odom_ + Vector3Map(parameters[0] + kGravity);
  residuals[0] = (g.norm() - magnitude_) / kGravitySigma;
  if (jacobians != nullptr && jacobians[0] != nullptr) {
    Eigen::Matrix<double, 1, kSharedSize> J = Eigen::Matrix<double, 1, kSharedSize>::Zero();
    J.segment<3>(kGravity) = g.normalized().transpose() / kGravitySigma;
    Eigen::Map<RowMajor<1, kSharedSize>>{jacobians[0]} = J;
  }
  return true;
}

Eigen::Vector3d map_bend(const Eigen::Vector3d& spin_axis, const Eigen::Vector3d& step_m, double radius_m) {
  return -spin_axis.cross(step_m) / std::max(radius_m, kLeastRadius);
}

void factorise(const Eigen::MatrixXd& H, const Eigen::VectorXd& b, double relative_tolerance,
               Eigen::MatrixXd* A, Eigen::VectorXd* e) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(0.5 * (H + H.transpose()));
  const Eigen::VectorXd& values = solver.eigenvalues();
  const double floor = std::max(values.maxCoeff(), 0.0) * relative_tolerance;
  Eigen::VectorXd root = Eigen::VectorXd::Zero(values.size());
  Eigen::VectorXd inverse_root = Eigen::VectorXd::Zero(values.size());
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    if (values[k] <= floor || values[k] <= 0.0) continue;
    root[k] = std::sqrt(values[k]);
    inverse_root[k] = 1.0 / root[k];
  }
  *A = root.asDiagonal() * solver.eigenvectors().transpose();
  *e = inverse_root.asDiagonal() * (solver.eigenvectors().transpose() * b);
}

}  // namespace fdi_lio::odometry
