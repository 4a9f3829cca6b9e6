#include "fdi_lio/odometry/smoother.hpp"

#include <algorithm>
#include <memory>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::odometry {

namespace {

/// Standard deviation of a mounting that is taken as stated [rad].
constexpr double kKnownMounting = 1e-6;
/// Standard deviation of a time offset that is taken as stated [s].
constexpr double kKnownTimeOffset = 1e-6;
/// Random walk of the time offset [s/sqrt(s)]: clocks that are not synchronised drift by some 1e-5 to 1e-4.
constexpr double kTimeOffsetWalk = 3e-4;
/// Standard deviation of a scale of the gyro that is taken as stated.
constexpr double kKnownGyroScale = 1e-6;
/// Standard deviation of an elevation of the beams that is taken as stated [rad].
constexpr double kKnownElevation = 1e-6;
/// Least variances of the walks of gravity, elevation and time offset, which must be some.
constexpr double kLeastGravityWalk = 1e-14;     // [(m/s^2)^2]
constexpr double kLeastElevationWalk = 1e-18;   // [rad^2]
constexpr double kLeastTimeOffsetWalk = 1e-18;  // [s^2]
/// Way on which the beams' common elevation may change by its standard deviation: bends of other causes,
/// which it stands for too, change with the surroundings [m].
constexpr double kElevationWay = 3000.0;
/// Places in a prior's vector.
constexpr int kGravity = kStateSize;
constexpr int kElevation = kStateSize + 6;
constexpr int kTimeOffset = kStateSize + 7;
constexpr int kGyroScale = kStateSize + 8;
constexpr int kMaxIterations = 3;  ///< the association is renewed outside, so that few inner steps suffice

Eigen::MatrixXd to_dense(const ceres::CRSMatrix& sparse) {
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
  for (int row = 0; row < sparse.num_rows; ++row) {
    for (int k = sparse.rows[row]; k < sparse.rows[row + 1]; ++k)
      dense(row, sparse.cols[k]) = sparse.values[k];
  }
  return dense;
}

ceres::Problem::Options problem_options() {
  ceres::Problem::Options options;
  options.disable_all_safety_checks = true;
  return options;
}

}  // namespace

/// The window as a Ceres problem over perturbations that start at zero.
class Smoother::Problem {
 public:
  /// With `count` states from the oldest on; `lidar_count` of them with their lidar information.
  Problem(const Smoother& smoother, std::size_t count, std::size_t lidar_count)
      : problem_(problem_options()), states_(count, Vector15d::Zero()) {
    const std::deque<Entry>& window = smoother.window_;
    for (Vector15d& state : states_) problem_.AddParameterBlock(state.data(), kStateSize);
    problem_.AddParameterBlock(shared_.data(), kSharedSize);
    problem_.AddResidualBlock(new PriorCost(window[0].state, smoother.prior_), nullptr, states_[0].data(),
                              shared_.data());
    for (std::size_t k = 1; k < count; ++k) {
      problem_.AddResidualBlock(new MotionCost(window[k - 1].state, window[k].state, window[k].motion,
                                               window[k].with_gravity, window[k].bend),
                                nullptr, states_[k - 1].data(), states_[k].data(), shared_.data());
    }
    for (std::size_t k = 0; k < lidar_count; ++k) {
      if (!window[k].lidar) continue;
      problem_.AddResidualBlock(new LidarCost(window[k].state, *window[k].lidar), nullptr, states_[k].data());
    }
  }

  void hold_gravity_norm(const imu::NavState& state, double magnitude) {
    problem_.AddResidualBlock(new GravityNormCost(state, magnitude), nullptr, shared_.data());
  }

  bool solve() {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.max_num_iterations = kMaxIterations;
    options.num_threads = 1;
    // The residuals are close to linear and neighbouring states strongly correlated: any noticeable damping
    // would leave the weak directions short of the minimum.
    options.initial_trust_region_radius = 1e12;
    options.max_trust_region_radius = 1e16;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    return summary.IsSolutionUsable();
  }

  /// Normal equations at zero perturbation, ordered by state and then what they share.
  void normal_equations(Eigen::MatrixXd* H, Eigen::VectorXd* b) {
    ceres::Problem::EvaluateOptions options;
    for (Vector15d& state : states_) options.parameter_blocks.push_back(state.data());
    options.parameter_blocks.push_back(shared_.data());
    std::vector<double> residuals;
    ceres::CRSMatrix jacobian;
    problem_.Evaluate(options, nullptr, &residuals, nullptr, &jacobian);
    const Eigen::MatrixXd J = to_dense(jacobian);
    *H = J.transpose() * J;
    *b = J.transpose() *
         Eigen::Map<const Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size()));
  }

  const Vector15d& state(std::size_t k) const { return states_[k]; }
  const SharedVector& shared() const { return shared_; }

 private:
  ceres::Problem problem_;
  std::vector<Vector15d> states_;
  SharedVector shared_ = SharedVector::Zero();
};

Smoother::Smoother(int window_size, double gravity_mps2, const CalibrationSigma& calibration,
                   double tilt_walk)
    : window_size_(window_size),
      gravity_mps2_(gravity_mps2),
      calibration_{std::max(calibration.mounting_rad, kKnownMounting),
                   std::max(calibration.lidar_time_offset_s, kKnownTimeOffset),
                   std::max(calibration.gyro_scale, kKnownGyroScale),
                   std::max(calibration.gyro_lean, kKnownGyroScale)},
      tilt_walk_(tilt_walk) {}

void Smoother::start(const imu::NavState& state, const InitialSigma& sigma) {
  window_.clear();
  window_.emplace_back();
  window_.back().state = state;
  prior_ = StatePrior();
  prior_.linearisation = state;
  const double sigmas[] = {sigma.theta,      sigma.position, sigma.velocity,           sigma.gyro_bias,
                           sigma.accel_bias, sigma.gravity,  calibration_.mounting_rad};
  beam_elevation_sigma_ = std::max(sigma.beam_elevation, kKnownElevation);
  PriorVector each;
  for (int k = 0; k < kElevation; ++k) each[k] = sigmas[k / 3];
  each[kElevation] = beam_elevation_sigma_;
  each[kTimeOffset] = calibration_.lidar_time_offset_s;
  Eigen::Matrix3d scales = Eigen::Matrix3d::Constant(calibration_.gyro_lean);
  scales.diagonal().setConstant(calibration_.gyro_scale);
  each.tail<9>() = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(scales.data());
  Eigen::MatrixXd H = each.cwiseAbs2().cwiseInverse().asDiagonal();
  if (sigma.rest_acceleration > 0.0) {
    // Measured at rest in the axes of the IMU: a = b_a - Exp(mounting)' R' g.
    const Eigen::Quaterniond q_odom_imu = state.q_odom_imu * so3::exp_q(state.mounting);
    Eigen::Matrix<double, 3, kPriorSize> J = Eigen::Matrix<double, 3, kPriorSize>::Zero();
    J.block<3, 3>(0, 12).setIdentity();
    J.block<3, 3>(0, kStateSize) = -q_odom_imu.toRotationMatrix().transpose();
    J.block<3, 3>(0, kStateSize + 3) =
        -so3::hat(q_odom_imu.conjugate() * state.g_odom) * so3::right_jacobian(state.mounting);
    H += J.transpose() * J / (sigma.rest_acceleration * sigma.rest_acceleration);
  }
  Eigen::MatrixXd A;
  Eigen::VectorXd e;
  factorise(H, Eigen::VectorXd::Zero(kPriorSize), 1e-16, &A, &e);
  prior_.sqrt_information = A;
}

void Smoother::add(const imu::NavState& predicted, const imu::Preintegration& motion, bool with_gravity,
                   const Eigen::Vector3d& bend) {
  while (static_cast<int>(window_.size()) >= window_size_) marginalise_oldest();
  Entry entry;
  entry.state = predicted;
  entry.motion = motion;
  entry.has_motion = true;
  entry.with_gravity = with_gravity;
  entry.bend = bend;
  window_.push_back(entry);
}

void Smoother::replace_newest(const imu::NavState& predicted, const imu::Preintegration& motion,
                              const imu::MotionError& error_before) {
  window_.back().state = predicted;
  window_.back().motion = motion;
  window_.back().lidar.reset();
  Entry& before = window_[window_.size() - 2];
  if (before.has_motion) before.motion = imu::with_error(before.motion, error_before);
}

void Smoother::reduce_beam_elevation(double taken_out) {
  for (Entry& entry : window_) entry.state.beam_elevation -= taken_out;
  prior_.linearisation.beam_elevation -= taken_out;
}

void Smoother::set_lidar(const matching::LidarInformation& information) {
  window_.back().lidar = information;
}

void Smoother::shift(const Eigen::Vector3d& velocity, const Eigen::Vector3d& gravity) {
  const auto move = [&](imu::NavState* state) {
    state->v_odom += velocity;
    state->g_odom = gravity_mps2_ * (state->g_odom + gravity).normalized();
  };
  for (Entry& entry : window_) move(&entry.state);
  move(&prior_.linearisation);
}

bool Smoother::solve() {
  Problem problem(*this, window_.size(), window_.size());
  problem.hold_gravity_norm(window_[0].state, gravity_mps2_);
  if (!problem.solve()) return false;
  for (std::size_t k = 0; k < window_.size(); ++k) {
    if (!problem.state(k).allFinite()) return false;
  }
  for (std::size_t k = 0; k < window_.size(); ++k) {
    window_[k].state = apply(window_[k].state, problem.state(k).data(), problem.shared().data());
  }
  return true;
}

void Smoother::annotate_newest(imu::ImuStatus status, const Eigen::Vector3d& w_imu) {
  window_.back().state.imu_status = status;
  window_.back().state.w_imu = w_imu;
}

Eigen::MatrixXd Smoother::information() const {
  Problem problem(*this, window_.size(), window_.size());
  problem.hold_gravity_norm(window_[0].state, gravity_mps2_);
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  problem.normal_equations(&H, &b);
  return H;
}

Matrix15d Smoother::covariance() const {
  const Eigen::MatrixXd H = information();
  const Eigen::Index first = static_cast<Eigen::Index>(kStateSize * (window_.size() - 1));
  Eigen::MatrixXd selected = Eigen::MatrixXd::Zero(H.rows(), kStateSize);
  selected.block(first, 0, kStateSize, kStateSize).setIdentity();
  const Eigen::MatrixXd columns = H.ldlt().solve(selected);
  const Matrix15d covariance = columns.block(first, 0, kStateSize, kStateSize);
  return 0.5 * (covariance + covariance.transpose());
}

GravityEstimate Smoother::gravity() const {
  const Eigen::MatrixXd H = information();
  const auto shared = static_cast<Eigen::Index>(kStateSize * window_.size());
  Eigen::MatrixXd selected = Eigen::MatrixXd::Zero(H.rows(), 9);
  selected.block<3, 3>(shared, 0).setIdentity();
  selected.block<3, 3>(shared - 3, 3).setIdentity();  // the newest accelerometer bias
  selected.block<3, 3>(shared + 3, 6).setIdentity();
  const imu::Matrix9d covariance = selected.transpose() * H.ldlt().solve(selected);
  GravityEstimate estimate;
  estimate.value << newest().g_odom, newest().accel_bias, newest().mounting;
  estimate.covariance = 0.5 * (covariance + covariance.transpose());
  if (window_.back().lidar) estimate.radius_m = window_.back().lidar->radius_m;
  return estimate;
}

/// Schur complement of the oldest state in the factors that touch it: what is known of the next state and of
/// what all share.
void Smoother::marginalise_oldest() {
  if (window_.size() < 2) {
    return;
  }
  Problem problem(*this, 2, 1);
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
  problem.normal_equations(&H, &b);
  const Eigen::MatrixXd Hmm = H.topLeftCorner<kStateSize, kStateSize>();
  const Eigen::MatrixXd Hrm = H.bottomLeftCorner<kPriorSize, kStateSize>();
  const Eigen::LDLT<Eigen::MatrixXd> solver(Hmm);
  Eigen::MatrixXd Hrr = H.bottomRightCorner<kPriorSize, kPriorSize>() - Hrm * solver.solve(Hrm.transpose());
  Eigen::VectorXd br = b.tail<kPriorSize>() - Hrm * solver.solve(b.head<kStateSize>());
  move_on(window_[0].state, window_[1], &Hrr, &br);
  Eigen::MatrixXd A;
  Eigen::VectorXd e;
  factorise(Hrr, br, 1e-16, &A, &e);
  prior_.sqrt_information = A;
  prior_.offset = e;
  prior_.linearisation = window_[1].state;
  window_.pop_front();
  window_.front().has_motion = false;
}

/// With x = [state, g, mounting, c, offset] the step is g' = g + (R k c) x g, or x' = A x + noise about the
/// values at `to`, and the information becomes A^-T H A^-1. The noise is added as P + G Q G' in terms of H =
/// P^-1 and b, by Woodbury's identity; G picks out gravity, whose magnitude a factor of its own holds, c and
/// the offset.
void Smoother::move_on(const imu::NavState& from, const Entry& to, Eigen::MatrixXd* H,
                       Eigen::VectorXd* b) const {
  const double step_m = (to.state.t_odom_imu - from.t_odom_imu).norm();
  const Eigen::Vector3d turn = (from.q_odom_imu * to.bend).cross(to.state.g_odom);
  PriorMatrix A_inverse = PriorMatrix::Identity();
  A_inverse.block<3, 1>(kGravity, kElevation) = -turn;
  PriorVector moved = PriorVector::Zero();
  moved.segment<3>(kGravity) = turn * to.state.beam_elevation;
  *H = A_inverse.transpose() * *H * A_inverse;
  *b = A_inverse.transpose() * *b - *H * moved;
  const double tilt_mps2 = tilt_walk_ * gravity_mps2_;
  const double elevation_rad2 = beam_elevation_sigma_ * beam_elevation_sigma_ * step_m / kElevationWay;
  const bool has_offset = calibration_.lidar_time_offset_s > kKnownTimeOffset;
  const double offset_s2 =
      has_offset ? kTimeOffsetWalk * kTimeOffsetWalk * seconds_between(from.stamp, to.state.stamp) : 0.0;
  using Walks = Eigen::Matrix<double, 5, 1>;
  Walks variances;
  variances.head<3>().setConstant(std::max(tilt_mps2 * tilt_mps2 * step_m, kLeastGravityWalk));
  variances[3] = std::max(elevation_rad2, kLeastElevationWalk);
  variances[4] = std::max(offset_s2, kLeastTimeOffsetWalk);
  Eigen::Matrix<double, kPriorSize, 5> G = Eigen::Matrix<double, kPriorSize, 5>::Zero();
  G.block<3, 3>(kGravity, 0).setIdentity();
  G(kElevation, 3) = 1.0;
  G(kTimeOffset, 4) = 1.0;
  const Eigen::Matrix<double, kPriorSize, 5> HG = *H * G;
  const Eigen::Matrix<double, 5, 5> S =
      (Eigen::Matrix<double, 5, 5>(variances.cwiseInverse().asDiagonal()) + G.transpose() * HG).inverse();
  const Walks b_walked = G.transpose() * *b;
  *H -= HG * S * HG.transpose();
  *b -= HG * S * b_walked;
}

}  // namespace fdi_lio::odometry
