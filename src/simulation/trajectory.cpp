#include "fdi_lio/simulation/trajectory.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr int kOrder = 6;  // control points that act at one time: degree 5
using Weights = std::array<double, kOrder>;

/// Rows: control point; columns: power of u, times 120. From the Cox-de Boor recursion for uniform knots.
constexpr double kBasis[kOrder][kOrder] = {
    {1, -5, 10, -10, 5, -1},    {26, -50, 20, 20, -20, 5}, {66, 0, -60, 0, 30, -10},
    {26, 50, 20, -20, -20, 10}, {1, 5, 10, 10, 5, -5},     {0, 0, 0, 0, 0, 1},
};

/// Weights of the control points at u in [0, 1), differentiated `derivative` times with respect to u.
Weights weights(double u, int derivative) {
  Weights result{};
  for (int k = 0; k < kOrder; ++k) {
    double power = 1.0;
    for (int j = derivative; j < kOrder; ++j) {
      double factor = 1.0;
      for (int d = 0; d < derivative; ++d) factor *= j - d;
      result[static_cast<std::size_t>(k)] += kBasis[k][j] / 120.0 * factor * power;
      power *= u;
    }
  }
  return result;
}

/// Body rates from the rates of roll, pitch, yaw for R = Rz Ry Rx.
Eigen::Vector3d body_rates(const PoseVector& pose, const PoseVector& rate) {
  const double sr = std::sin(pose[3]), cr = std::cos(pose[3]);
  const double sp = std::sin(pose[4]), cp = std::cos(pose[4]);
  return {rate[3] - sp * rate[5], cr * rate[4] + sr * cp * rate[5], -sr * rate[4] + cr * cp * rate[5]};
}

}  // namespace

Eigen::Matrix3d rotation_from_angles(double roll, double pitch, double yaw) {
  return (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

Trajectory::Trajectory(std::vector<PoseVector> poses, double knot_period_s)
    : poses_(std::move(poses)), knot_period_s_(knot_period_s) {
  if (poses_.size() < 2 || !(knot_period_s > 0.0)) throw Error("a trajectory needs at least two poses");
}

PoseVector Trajectory::control_point(std::int64_t index) const {
  const auto last = static_cast<std::int64_t>(poses_.size()) - 1;
  if (index < 0) return poses_[0] + static_cast<double>(index) * (poses_[1] - poses_[0]);
  if (index <= last) return poses_[static_cast<std::size_t>(index)];
  return poses_.back() + static_cast<double>(index - last) * (poses_.back() - poses_[poses_.size() - 2]);
}

PoseVector Trajectory::blend(double t, int derivative) const {
  const double knots = t / knot_period_s_;
  const double whole = std::floor(knots);
  const Weights w = weights(knots - whole, derivative);
  PoseVector sum = PoseVector::Zero();
  for (int k = 0; k < kOrder; ++k)
    sum += w[static_cast<std::size_t>(k)] * control_point(static_cast<std::int64_t>(whole) + k - 2);
  return sum / std::pow(knot_period_s_, derivative);
}

MotionState Trajectory::evaluate(double t) const {
  const PoseVector pose = blend(t, 0);
  const PoseVector rate = blend(t, 1);
  MotionState state;
  state.T_map_imu.translation() = pose.head<3>();
  state.T_map_imu.linear() = rotation_from_angles(pose[3], pose[4], pose[5]);
  state.v_map = rate.head<3>();
  state.a_map = blend(t, 2).head<3>();
  state.w_imu = body_rates(pose, rate);
  return state;
}

Eigen::Isometry3d Trajectory::pose(double t) const {
  const PoseVector pose = blend(t, 0);
  Eigen::Isometry3d T_map_imu = Eigen::Isometry3d::Identity();
  T_map_imu.translation() = pose.head<3>();
  T_map_imu.linear() = rotation_from_angles(pose[3], pose[4], pose[5]);
  return T_map_imu;
}

double Trajectory::length_m() const {
  double length = 0.0;
  for (std::size_t i = 1; i < poses_.size(); ++i) length += (poses_[i] - poses_[i - 1]).head<3>().norm();
  return length;
}

Trajectory revisit(const Trajectory& drive, double begin_s, bool reversed, double duration_s) {
  constexpr double kKnotPeriodS = 0.04;
  constexpr double kStandS = 2.0;
  constexpr double kRampS = 5.0;  // until it drives as fast as the first one did there
  std::vector<PoseVector> poses;
  double yaw = 0.0;
  for (double t = 0.0; t < duration_s + 1.0; t += kKnotPeriodS) {
    // The integral of a speed that rises with 3 u^2 - 2 u^3.
    const double u = std::clamp((t - kStandS) / kRampS, 0.0, 1.0);
    const double passed_s = kRampS * (u * u * u - 0.5 * u * u * u * u) + std::max(0.0, t - kStandS - kRampS);
    Eigen::Isometry3d T = drive.pose(begin_s + (reversed ? -passed_s : passed_s));
    if (reversed) T.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
    const Eigen::Matrix3d R = T.rotation();
    const double wrapped_yaw = std::atan2(R(1, 0), R(0, 0));
    yaw = poses.empty() ? wrapped_yaw : yaw + std::remainder(wrapped_yaw - yaw, 2.0 * M_PI);
    PoseVector pose;
    pose << T.translation(), std::atan2(R(2, 1), R(2, 2)), std::asin(-R(2, 0)), yaw;
    poses.push_back(pose);
  }
  return Trajectory(std::move(poses), kKnotPeriodS);
}

}  // namespace fdi_lio::simulation
