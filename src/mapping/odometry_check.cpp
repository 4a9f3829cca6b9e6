#include "fdi_lio/mapping/odometry_check.hpp"

#include <algorithm>
#include <numeric>

#include <Eigen/Cholesky>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr double kDegreesOfFreedom = 6.0;
/// Chi-square over its degrees of freedom, from which a step deviates. The random walk of the graph's steps
/// allows for what all scans have in common (calibration, a map that bends), which does not show in a
/// registration: a healthy odometry stays far below 1. docs/global_consistency.md has the figures.
constexpr double kDeviating = 0.2;

/// Fewer steps contradict nothing: the first ones have hardly a map to be registered with.
constexpr std::size_t kFewest = 5;

bool deviates(double deviation) { return deviation > kDeviating; }

}  // namespace

bool OdometryCheck::is_due() {
  const bool is_healthy =
      deviations_.size() >= kWindow && std::none_of(deviations_.begin(), deviations_.end(), deviates);
  if (is_healthy && ++unchecked_ < kSparse) return false;
  unchecked_ = 0;
  return true;
}

void OdometryCheck::remember(double deviation) {
  deviations_.push_back(deviation);
  if (deviations_.size() > kWindow) deviations_.pop_front();
}

bool OdometryCheck::contradicts() const {
  const auto count =
      static_cast<std::size_t>(std::count_if(deviations_.begin(), deviations_.end(), deviates));
  return deviations_.size() >= kFewest && 2 * count > deviations_.size();
}

RelativePose OdometryCheck::checked(const RelativePose& odometry, const RelativePose& registered) {
  const Matrix6d C = odometry.information.inverse();
  const Matrix6d C_registered = registered.information.inverse();
  const Vector6d error = difference(odometry.T_from_to, registered.T_from_to);
  const Matrix6d sum = C + C_registered;
  remember(error.dot(sum.ldlt().solve(error)) / kDegreesOfFreedom);
  const auto count =
      static_cast<std::size_t>(std::count_if(deviations_.begin(), deviations_.end(), deviates));
  if (2 * count <= deviations_.size()) return odometry;
  const double mean =
      std::accumulate(deviations_.begin(), deviations_.end(), 0.0) / static_cast<double>(deviations_.size());
  const Matrix6d C_scaled = std::max(1.0, mean) * C;
  const Matrix6d K = C_scaled * (C_scaled + C_registered).inverse();
  RelativePose step = odometry;
  step.T_from_to = moved(odometry.T_from_to, K * error);
  const Matrix6d covariance = C + (Matrix6d::Identity() - K) * C_scaled;
  step.information = (0.5 * (covariance + covariance.transpose())).inverse();
  return step;
}

}  // namespace fdi_lio::mapping
