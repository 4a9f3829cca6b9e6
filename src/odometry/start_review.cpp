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
constexpr double kLeastLead = 1.0;        ///< of one that the estimate loses to by kSureLead
constexpr double kLeadOverWitness = 4.0;  ///< against surfaces that told another motion
constexpr double kLeadOverScans = 8.0;    ///< against the first two scans, too
/// By more than this share of the best score two scans contradict a motion: where the way is hardly seen
/// (tunnels), the true one is worse than some other by up to 0.08.
constexpr double kMostDisadvantage = 0.1;

/// With one direction open fewer compete, and none of them for what traffic does across.
bool is_sure_of(const BrightnessMotion& motion, bool against_witness, bool has_open_direction) {
  if (against_witness) return motion.lead >= kLeadOverWitness;
  const bool is_likely = motion.lead >= kLeastLead && motion.lead_over_known >= kSureLead;
  return motion.lead >= kSureLead || (has_open_direction && is_likely);
}

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
      has_ground_ = true;
    }
  }
  if (has_imu) {
    felt_m_ += input.imu->duration_s() * felt_mps_ + before * input.imu->delta_p;
    felt_mps_ += before * input.imu->delta_v;
    felt_s_ += input.imu->duration_s();
  }
  const Eigen::Matrix3d R_level_imu = R_level_odom_ * q_odom_imu.toRotationMatrix();
  position_information_ += R_level_imu * position_information * R_level_imu.transpose();
  BrightScan scan = bright_scan(input.features, R_level_odom_ * R_odom_lidar, R_level_odom_ * input.v_deskew);
  scan.gained_mps = R_level_odom_ * felt_mps_;
  scan.gained_m = R_level_odom_ * felt_m_;
  scans_.push_back(std::move(scan));
  felt_s_of_.push_back(felt_s_);
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

/// What the accelerometer felt over all scans: one of them may fall into a jerk.
Eigen::Vector3d StartReview::felt_up() const {
  return felt_s_ > 0.0 ? Eigen::Vector3d(felt_mps_.normalized()) : Eigen::Vector3d::UnitZ();
}

bool StartReview::is_ground_steep() const {
  return has_ground_ && felt_s_ > 0.0 && is_steep(R_level_odom_.transpose().col(2), felt_up());
}

std::vector<BrightScan> StartReview::scans_without_gravity(const Eigen::Vector3d& up_odom) const {
  const Eigen::Vector3d g_level = -config_.sensor.gravity_mps2 * (R_level_odom_ * up_odom);
  std::vector<BrightScan> scans = scans_;
  for (std::size_t k = 0; k < scans.size(); ++k) {
    scans[k].gained_mps += felt_s_of_[k] * g_level;
    scans[k].gained_m += 0.5 * felt_s_of_[k] * felt_s_of_[k] * g_level;
  }
  return scans;
}

std::optional<MovingStart> StartReview::find_motion(bool has_witness, bool seems_to_stand) {
  if (is_over_ || scans_.size() < next_question_ || may_stand()) return std::nullopt;
  next_question_ = kLastQuestion;
  KnownMotion known;
  known.way = R_level_odom_ * (newest_t_odom_imu_ - first_t_odom_imu_);
  known.open_direction = open_direction();
  if (seems_to_stand && !known.open_direction) {
    is_over_ = true;
    return std::nullopt;
  }
  const bool by_ground = is_ground_steep();
  const Eigen::Vector3d up_odom = by_ground ? Eigen::Vector3d(R_level_odom_.transpose().col(2)) : felt_up();
  const BrightnessMotion motion = find_brightness_motion(scans_without_gravity(up_odom), known);
  const bool is_sure = is_sure_of(motion, has_witness && !motion.is_known, known.open_direction.has_value());
  const bool is_other =
      !motion.is_known || motion.lead_over_known >= (has_witness ? kLeadOverWitness : kSureLead);
  MovingStart start;
  start.v_odom = R_level_odom_.transpose() * motion.velocity;
  const bool is_refuted =
      is_sure && is_other && has_witness && motion.lead < kLeadOverScans && is_contradicted(start.v_odom);
  is_over_ = (is_sure && !is_refuted) || scans_.size() >= kLastQuestion;
  if (!is_sure || !is_other || is_refuted) return std::nullopt;
  start.up_odom = up_odom;
  start.sigma.velocity = kVelocitySigma;
  start.sigma.gyro_bias = kGyroBiasSigma;
  start.sigma.accel_bias = kAccelBiasSigma;
  start.sigma.gravity = by_ground ? kGroundGravitySigma : kCruisingGravitySigma;
  return start;
}

}  // namespace fdi_lio::odometry
