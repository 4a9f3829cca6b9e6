#include "fdi_lio/mapping/start_review.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>

#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/scan/ground_plane.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr std::size_t kLastQuestion = 16;
constexpr float kGroundReachM = 20.0F;
constexpr double kMostTilt = 20.0 * M_PI / 180.0;
constexpr double kLeastGround = 0.06;  ///< of the points that are looked at
constexpr double kMostBelow = 0.2;     ///< of as many as the ground has, nothing is seen through it
/// Of the ground against the accelerometer: roads are not as steep, who feels so gathers speed, or brakes.
constexpr double kSteep = 5.0 * M_PI / 180.0;
constexpr double kCruisingGravitySigma = 0.15;  ///< what traffic accelerates by, mostly [m/s^2]
constexpr double kGroundGravitySigma = 0.5;     ///< how steep roads are
/// Information along a level direction that surfaces leave open, as a share of that across.
constexpr double kOpenShare = 0.1;
constexpr double kSureLead = 2.0;         ///< in votes
constexpr double kLeadOverWitness = 4.0;  ///< against surfaces that told another motion

/// The turn of `odom` after which the ground about the sensor is level; none without a ground.
Eigen::Matrix3d level_by_ground(const FeatureSet& features, const Eigen::Matrix3d& R_odom_lidar) {
  std::vector<Eigen::Vector3f> near;
  for (const Point& point : features.planes) {
    if (point.position.norm() < kGroundReachM) near.push_back(R_odom_lidar.cast<float>() * point.position);
  }
  const scan::Plane ground = scan::find_plane(near, Eigen::Vector3d::UnitZ(), kMostTilt);
  if (ground.share < kLeastGround || ground.below > kMostBelow * ground.share)
    return Eigen::Matrix3d::Identity();
  return Eigen::Quaterniond::FromTwoVectors(ground.normal, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

}  // namespace

StartReview::StartReview(const Config& config)
    : config_(config), R_imu_lidar_(config.sensor.T_imu_lidar().linear()) {}

void StartReview::add(EstimatorInput input, const imu::NavState& state,
                      const Eigen::Matrix3d& position_information) {
  if (inputs_.empty()) first_t_odom_imu_ = state.t_odom_imu;
  newest_t_odom_imu_ = state.t_odom_imu;
  const bool has_imu = !inputs_.empty() && input.imu && input.imu->sample_count > 0;
  const Eigen::Quaterniond before = q_odom_imu_;
  q_odom_imu_ = has_imu ? (before * input.imu->delta_q).normalized() : state.q_odom_imu;
  const Eigen::Matrix3d R_odom_lidar = q_odom_imu_ * R_imu_lidar_;
  if (inputs_.empty()) {
    R_level_odom_ = level_by_ground(input.features, R_odom_lidar);
    is_steep_ = input.imu && R_level_odom_(2, 2) < std::cos(kSteep);
  }
  if (has_imu) {
    const double dt = input.imu->duration_s();
    const Eigen::Vector3d g_odom = -config_.sensor.gravity_mps2 * up();
    gained_m_ += dt * gained_mps_ + before * input.imu->delta_p + 0.5 * dt * dt * g_odom;
    gained_mps_ += before * input.imu->delta_v + dt * g_odom;
  }
  const Eigen::Matrix3d R_level_imu = R_level_odom_ * q_odom_imu_.toRotationMatrix();
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

/// `odom` stands upright by what the accelerometer felt at the first scan.
Eigen::Vector3d StartReview::up() const {
  return is_steep_ ? Eigen::Vector3d(R_level_odom_.transpose().col(2)) : Eigen::Vector3d::UnitZ();
}

std::optional<MovingStart> StartReview::find_motion(bool has_witness) {
  if (scans_.size() < next_question_ || may_stand()) return std::nullopt;
  next_question_ = kLastQuestion;
  KnownMotion known;
  known.way = R_level_odom_ * (newest_t_odom_imu_ - first_t_odom_imu_);
  known.open_direction = open_direction();
  const BrightnessMotion motion = find_brightness_motion(scans_, known);
  const bool is_sure = motion.lead >= (has_witness && !motion.is_known ? kLeadOverWitness : kSureLead);
  is_over_ = is_sure || scans_.size() >= kLastQuestion;
  if (!is_sure || motion.is_known) return std::nullopt;
  MovingStart start;
  start.v_odom = R_level_odom_.transpose() * motion.velocity;
  start.up_odom = up();
  start.gravity_sigma_mps2 = is_steep_ ? kGroundGravitySigma : kCruisingGravitySigma;
  return start;
}

}  // namespace fdi_lio::mapping
