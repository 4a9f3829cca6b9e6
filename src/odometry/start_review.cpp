#include "fdi_lio/odometry/start_review.hpp"

#include <utility>

#include <Eigen/Eigenvalues>

#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/odometry/start_ground.hpp"
#include "fdi_lio/odometry/start_motion.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr std::size_t kLastQuestion = 16;
constexpr double kCruisingGravitySigma = 0.15;  ///< what traffic accelerates by, mostly [m/s^2]
constexpr double kGroundGravitySigma = 0.5;     ///< how steep roads are
constexpr double kVelocitySigma = 0.3;          ///< [m/s]
constexpr double kGyroBiasSigma = 0.02;
constexpr double kAccelBiasSigma = 0.05;
/// Information along a level direction that surfaces leave open, as a share of that across.
constexpr double kOpenShare = 0.1;
constexpr double kSureLead = 2.0;         ///< in votes
constexpr double kLeadOverWitness = 4.0;  ///< against surfaces that told another motion
/// By more than this share of the best score two scans contradict a motion: where the way is hardly seen
/// (tunnels), the true one is worse than some other by up to 0.08.
constexpr double kMostDisadvantage = 0.1;

}  // namespace

StartReview::StartReview(const Config& config) : config_(config), T_imu_lidar_(config.sensor.T_imu_lidar()) {}

void StartReview::add(EstimatorInput input, const imu::NavState& state,
                      const Eigen::Matrix3d& position_information) {
  if (is_over_) {
    inputs_.push_back(std::move(input));
    return;
  }
  if (inputs_.empty()) first_t_odom_imu_ = state.t_odom_imu;
  newest_t_odom_imu_ = state.t_odom_imu;
  const bool has_imu = !inputs_.empty() && input.imu && input.imu->sample_count > 0;
  const Eigen::Quaterniond before = has_imu ? q_odom_imu_.back() : state.q_odom_imu;
  const Eigen::Quaterniond q_odom_imu = has_imu ? (before * input.imu->delta_q).normalized() : before;
  q_odom_imu_.push_back(q_odom_imu);
  const Eigen::Matrix3d R_odom_lidar = q_odom_imu * T_imu_lidar_.linear();
  if (inputs_.empty()) {
    if (const auto normal = find_ground(input.features, R_odom_lidar)) {
      R_level_odom_ =
          Eigen::Quaterniond::FromTwoVectors(*normal, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      is_steep_ = input.imu && is_steep(*normal, Eigen::Vector3d::UnitZ());
    }
  }
  if (has_imu) {
    const double dt = input.imu->duration_s();
    const Eigen::Vector3d g_odom = -config_.sensor.gravity_mps2 * up();
    gained_m_ += dt * gained_mps_ + before * input.imu->delta_p + 0.5 * dt * dt * g_odom;
    gained_mps_ += before * input.imu->delta_v + dt * g_odom;
  }
  const Eigen::Matrix3d R_level_imu = R_level_odom_ * q_odom_imu.toRotationMatrix();
  position_information_ += R_level_imu * position_information * R_level_imu.transpose();
  BrightScan scan = bright_scan(input.features, R_level_odom_ * R_odom_lidar, R_level_odom_ * input.v_deskew);
  scan.gained_mps = R_level_odom_ * gained_mps_;
  scan.gained_m = R_level_odom_ * gained_m_;
  scans_.push_back(std::move(scan));
  inputs_.push_back(std::move(input));
}

/// The IMU is calm, but not for long enough to say that the sensor stands: the question would only hold it
/// up.
bool StartReview::may_stand() const {
  const auto& imu = inputs_.back().imu;
  return imu && scans_.size() < kLastQuestion && imu::is_calm(imu->recent, config_.imu) &&
         !imu::is_long_enough(imu->recent, config_.imu);
}

std::optional<Eigen::Vector3d> StartReview::open_direction() const {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(
      Eigen::Matrix2d(position_information_.topLeftCorner<2, 2>()));
  if (eigen.eigenvalues()(0) >= kOpenShare * eigen.eigenvalues()(1)) return std::nullopt;
  return Eigen::Vector3d(eigen.eigenvectors()(0, 0), eigen.eigenvectors()(1, 0), 0.0);
}

/// The first two scans told a faster motion, and this one explains them much worse. Not the other way round:
/// traffic that drives along hides speed, but hardly anything feigns it.
bool StartReview::is_contradicted(const Eigen::Vector3d& v_odom) const {
  const FeatureSet& first = inputs_[0].features;
  const FeatureSet& second = inputs_[1].features;
  const Eigen::Vector3d displacement = seconds_between(first.stamp, second.stamp) * v_odom;
  const auto motion =
      find_start_motion(first, q_odom_imu_[0], second, q_odom_imu_[1], T_imu_lidar_, displacement);
  return motion && displacement.norm() < motion->displacement.norm() &&
         motion->score - motion->score_predicted > kMostDisadvantage * motion->score;
}

/// `odom` stands upright by what the accelerometer felt at the first scan.
Eigen::Vector3d StartReview::up() const {
  return is_steep_ ? Eigen::Vector3d(R_level_odom_.transpose().col(2)) : Eigen::Vector3d::UnitZ();
}

std::optional<MovingStart> StartReview::find_motion(bool has_witness) {
  if (is_over_ || scans_.size() < next_question_ || may_stand()) return std::nullopt;
  next_question_ = kLastQuestion;
  KnownMotion known;
  known.way = R_level_odom_ * (newest_t_odom_imu_ - first_t_odom_imu_);
  known.open_direction = open_direction();
  const BrightnessMotion motion = find_brightness_motion(scans_, known);
  const bool is_sure = motion.lead >= (has_witness && !motion.is_known ? kLeadOverWitness : kSureLead);
  MovingStart start;
  start.v_odom = R_level_odom_.transpose() * motion.velocity;
  const bool is_refuted = is_sure && !motion.is_known && has_witness && is_contradicted(start.v_odom);
  is_over_ = (is_sure && !is_refuted) || scans_.size() >= kLastQuestion;
  if (!is_sure || motion.is_known || is_refuted) return std::nullopt;
  start.up_odom = up();
  start.sigma.velocity = kVelocitySigma;
  start.sigma.gyro_bias = kGyroBiasSigma;
  start.sigma.accel_bias = kAccelBiasSigma;
  start.sigma.gravity = is_steep_ ? kGroundGravitySigma : kCruisingGravitySigma;
  return start;
}

}  // namespace fdi_lio::odometry
