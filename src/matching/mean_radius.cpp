#include "fdi_lio/matching/mean_radius.hpp"

#include <algorithm>

#include <Eigen/Cholesky>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::matching {

namespace {

/// Share of what is known that the next scan leaves: other places have other things.
constexpr double kMemory = 0.99;
/// Of a pose that nothing else constrains [1/rad^2, 1/m^2]: keeps the elimination regular.
constexpr double kLeastPoseInformation = 1e-3;

}  // namespace

MeanRadius::MeanRadius(double sigma_m)
    : least_information_(sigma_m > 0.0 ? 1.0 / (sigma_m * sigma_m) : 0.0), information_(least_information_) {}

RadiusEvidence MeanRadius::eliminate(LidarInformation* information) const {
  const RadiusSums& sums = information->radius;
  if (least_information_ <= 0.0 || sums.information <= 0.0) return {};
  const Matrix6d H = information->H + kLeastPoseInformation * Matrix6d::Identity();
  const Vector6d pose_by_radius = H.ldlt().solve(sums.with_pose);
  RadiusEvidence evidence;
  evidence.information = std::max(0.0, sums.information - sums.with_pose.dot(pose_by_radius));
  evidence.gradient = sums.gradient - pose_by_radius.dot(information->b);
  const double total = sums.information + information_;
  information->H -= sums.with_pose * sums.with_pose.transpose() / total;
  information->b -= sums.with_pose * (sums.gradient / total);
  return evidence;
}

void MeanRadius::learn(const RadiusEvidence& evidence) {
  if (least_information_ <= 0.0) return;
  information_ = least_information_ + kMemory * (information_ - least_information_) + evidence.information;
  mean_m_ -= evidence.gradient / information_;
}

}  // namespace fdi_lio::matching
