#include "fdi_lio/mapping/external_odometry.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kDegree = M_PI / 180.0;
/// Drivers write 1e3, 1e6, 99999 or 1e9 for an axis that they do not know.
constexpr double kUnknownVariance = 1e3;
constexpr double kUnknownSigma = 1e3;
/// A vehicle may stand for hours, without a keyframe.
constexpr std::size_t kMostPoses = 100000;
/// What no step is better than.
constexpr double kLeastSigmaM = 0.005;
constexpr double kLeastSigmaRad = 0.1 * kDegree;
/// Error of a turn as a share of it: wheels slip when the vehicle turns.
constexpr double kTurnShare = 0.1;

bool is_earlier(const ExternalPose& pose, Stamp stamp) { return pose.stamp < stamp; }

}  // namespace

ExternalOdometry::ExternalOdometry(const ExternalOdometryConfig& config)
    : config_(config), T_imu_child_(config.T_imu_child()) {}

bool ExternalOdometry::add(const ExternalPose& pose) {
  // A quaternion without length turns into a matrix of nothing, or of the identity: look at the matrix.
  const Eigen::Matrix3d R = pose.T_world_child.linear();
  const bool is_rotation = R.allFinite() && (R * R.transpose()).isIdentity(1e-3) && R.determinant() > 0.0;
  const bool is_finite = pose.T_world_child.translation().allFinite() && pose.twist_variance.allFinite() &&
                         pose.pose_variance.allFinite();
  if (!is_rotation || !is_finite || (!poses_.empty() && pose.stamp <= poses_.back().stamp)) return false;
  poses_.push_back(pose);
  if (poses_.size() > kMostPoses) poses_.pop_front();
  return true;
}

void ExternalOdometry::forget_before(Stamp stamp) {
  while (poses_.size() > 1 && poses_[1].stamp <= stamp) poses_.pop_front();
}

std::optional<Eigen::Isometry3d> ExternalOdometry::pose_at(Stamp stamp) const {
  const auto after = std::lower_bound(poses_.begin(), poses_.end(), stamp, is_earlier);
  if (after == poses_.end()) return std::nullopt;
  if (after->stamp == stamp) return after->T_world_child;
  if (after == poses_.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap_s = seconds_between(before->stamp, after->stamp);
  if (gap_s > config_.max_gap_s) return std::nullopt;
  return interpolated(before->T_world_child, after->T_world_child,
                      seconds_between(before->stamp, stamp) / gap_s);
}

Matrix6d ExternalOdometry::covariance_of(const Eigen::Isometry3d& T_step, double duration_s,
                                         const ExternalPose& stated) const {
  const double way_m = T_step.translation().norm();
  const double turn_rad = so3::log(Eigen::Matrix3d(T_step.linear())).norm();
  Vector6d sigma;
  sigma.head<3>().setConstant(config_.sigma_rotation_deg_per_m * kDegree * way_m + kTurnShare * turn_rad +
                              kLeastSigmaRad);
  sigma.tail<3>().setConstant(config_.sigma_translation * way_m + kLeastSigmaM);
  Vector6d variance = sigma.cwiseAbs2();
  for (int k = 0; k < 6; ++k) {
    const bool is_unknown =
        stated.twist_variance[k] >= kUnknownVariance || stated.pose_variance[k] >= kUnknownVariance;
    variance[k] += is_unknown ? kUnknownSigma * kUnknownSigma
                              : std::max(0.0, stated.twist_variance[k]) * duration_s * duration_s;
  }
  return variance.asDiagonal();
}

std::optional<ExternalStep> ExternalOdometry::step(Stamp from, Stamp to) const {
  const auto T_world_from = pose_at(from);
  const auto T_world_to = pose_at(to);
  if (!T_world_from || !T_world_to) return std::nullopt;
  const Eigen::Isometry3d T_child = T_world_from->inverse() * *T_world_to;
  const auto stated = std::lower_bound(poses_.begin(), poses_.end(), to, is_earlier);
  const Matrix6d covariance = covariance_of(T_child, seconds_between(from, to), *stated);
  ExternalStep step;
  RelativePose& measured = step.measured;
  measured.T_from_to = T_imu_child_ * T_child * T_imu_child_.inverse();
  step.way = T_imu_child_.linear() * T_child.translation();
  // With X = T_imu_child: dtheta_imu = R_X dtheta, dt_imu = R_X dt + R_X R_child hat(R_X' t_X) dtheta.
  const Eigen::Matrix3d R = T_imu_child_.linear();
  Matrix6d to_imu = Matrix6d::Zero();
  to_imu.topLeftCorner<3, 3>() = R;
  to_imu.bottomRightCorner<3, 3>() = R;
  to_imu.bottomLeftCorner<3, 3>() =
      R * T_child.linear() * so3::hat(R.transpose() * T_imu_child_.translation());
  measured.information = (to_imu * covariance * to_imu.transpose()).inverse();
  return step;
}

}  // namespace fdi_lio::mapping
