#include "fdi_lio/mapping/renewed_way.hpp"

#include <algorithm>

namespace fdi_lio::mapping {

namespace {

/// Distance of two places that see other features, over the features' radius.
constexpr double kReach = 2.0;

}  // namespace

void RenewedWay::advance(const Eigen::Vector3d& t_odom, double radius_m) {
  if (!anchor_) anchor_ = t_odom;
  if (radius_m > 0.0) radius_m_ = radius_m;
  const Eigen::Vector3d ahead = t_odom - *anchor_;
  const double distance_m = ahead.norm();
  const double step_m = std::max(0.0, distance_m - kReach * radius_m_);
  if (step_m > 0.0) *anchor_ += step_m / distance_m * ahead;
  way_m_ += step_m;
}

}  // namespace fdi_lio::mapping
