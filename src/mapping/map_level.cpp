#include "fdi_lio/mapping/map_level.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/preintegration.hpp"

namespace fdi_lio::mapping {

namespace {

using Vector9d = Eigen::Matrix<double, 9, 1>;
using imu::Matrix9d;

/// Without it gravity's magnitude, which is known, and a mounting that is not estimated have no inverse.
constexpr double kLeastShare = 1e-9;
/// What is known of gravity cannot become less by a measurement: where its variance exceeds what it should be
/// by this factor, the odometry has begun anew, and what came before does not hold there.
constexpr double kBegunAnew = 2.0;

double variance_of_gravity(const Matrix9d& covariance) { return covariance.topLeftCorner<3, 3>().trace(); }

}  // namespace

MapLevel::MapLevel(const Config& config)
    : tilt_walk_mps2_(config.mapping.tilt_walk_deg * M_PI / 180.0 * config.sensor.gravity_mps2),
      accel_bias_walk_(imu::noise_of(config.sensor, imu::ImuStatistics()).accel_bias_walk) {}

void MapLevel::add(Stamp stamp, const Eigen::Vector3d& t_odom_imu,
                   const std::optional<odometry::GravityEstimate>& gravity) {
  way_.advance(t_odom_imu, gravity ? gravity->radius_m : 0.0);
  entries_.push_back({stamp, way_.way_m(), gravity});
}

/// One step backwards; `smoothed` is what `at` knew by itself when nothing leads from it to `next`.
void MapLevel::smooth(const Entry& at, const Entry& next, const Vector9d& smoothed_next,
                      Vector9d* smoothed) const {
  const Matrix9d& P = at.gravity->covariance;
  Matrix9d predicted = P;
  predicted.diagonal().head<3>().array() += tilt_walk_mps2_ * tilt_walk_mps2_ * (next.way_m - at.way_m);
  predicted.diagonal().segment<3>(3).array() +=
      accel_bias_walk_ * accel_bias_walk_ * seconds_between(at.stamp, next.stamp);
  *smoothed = at.gravity->value;
  if (variance_of_gravity(next.gravity->covariance) > kBegunAnew * variance_of_gravity(predicted)) return;
  // Units differ: with each by its own deviation.
  const Vector9d scale = predicted.diagonal().cwiseMax(1e-30).cwiseSqrt().cwiseInverse();
  Matrix9d scaled = scale.asDiagonal() * predicted * scale.asDiagonal();
  scaled.diagonal().array() += kLeastShare;
  const Vector9d change = scale.cwiseProduct(smoothed_next - at.gravity->value);
  *smoothed += P * scale.cwiseProduct(scaled.ldlt().solve(change));
}

std::vector<Eigen::Vector3d> MapLevel::down_odom() const {
  std::vector<Eigen::Vector3d> down(entries_.size());
  const Entry* next = nullptr;
  Vector9d smoothed_next = Vector9d::Zero();
  std::size_t last_known = 0;
  for (std::size_t k = entries_.size(); k-- > 0;) {
    if (entries_[k].gravity) {
      Vector9d smoothed = entries_[k].gravity->value;
      if (next != nullptr) smooth(entries_[k], *next, smoothed_next, &smoothed);
      smoothed_next = smoothed;
      if (next == nullptr) last_known = k;
      next = &entries_[k];
    }
    if (next != nullptr) down[k] = smoothed_next.head<3>().normalized();
  }
  if (next == nullptr) return {};
  // Behind the last that knows it, the map stays as it was there.
  for (std::size_t k = last_known + 1; k < down.size(); ++k) down[k] = down[last_known];
  return down;
}

std::vector<Eigen::Vector3d> MapLevel::tilts() const {
  std::vector<Eigen::Vector3d> tilts(entries_.size(), Eigen::Vector3d::Zero());
  const std::vector<Eigen::Vector3d> down = down_odom();
  for (std::size_t k = 0; k < down.size(); ++k) {
    const Eigen::Vector3d axis = down.front().cross(down[k]);
    const double sine = axis.norm();
    if (sine > 0.0) tilts[k] = axis / sine * std::atan2(sine, down.front().dot(down[k]));
  }
  return tilts;
}

std::vector<Eigen::Isometry3d> levelled_poses(const std::vector<Eigen::Isometry3d>& poses,
                                              const std::vector<Eigen::Vector3d>& tilts) {
  std::vector<Eigen::Isometry3d> levelled = poses;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    levelled[k].linear() = so3::exp(Eigen::Vector3d(-tilts[k])) * poses[k].linear();
    if (k == 0) continue;
    const Eigen::Vector3d step = poses[k].translation() - poses[k - 1].translation();
    levelled[k].translation() =
        levelled[k - 1].translation() + so3::exp(Eigen::Vector3d(-0.5 * (tilts[k - 1] + tilts[k]))) * step;
  }
  return levelled;
}

}  // namespace fdi_lio::mapping
