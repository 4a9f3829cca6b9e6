#include "fdi_lio/mapping/map_display.hpp"

#include <cstddef>

namespace fdi_lio::mapping {

namespace {
/// Most of what a keyframe saw is nearer.
constexpr double kReachM = 20.0;
}  // namespace

bool MapDisplay::has_moved(const GlobalOptimizer& global) const {
  for (std::size_t k = 0; k < placed_.size(); ++k) {
    const Eigen::Isometry3d T = placed_[k].inverse() * global.T_map_imu(k);
    const double moved_m = T.translation().norm() + kReachM * Eigen::AngleAxisd(T.linear()).angle();
    if (moved_m > 0.5 * voxel_m_) return true;
  }
  return false;
}

void MapDisplay::follow(const GlobalOptimizer& global) {
  if (has_moved(global)) {
    settled_.clear();
    placed_.clear();
  }
  for (std::size_t k = placed_.size(); k < global.cleaned(); ++k) {
    const auto cloud = global.cloud(k);  // first what may throw
    placed_.push_back(global.T_map_imu(k));
    settled_.add(cloud->surface, placed_.back());
  }
  newest_.clear();
  for (std::size_t k = placed_.size(); k < global.size(); ++k)
    newest_.add(global.cloud(k)->surface, global.T_map_imu(k));
}

std::vector<Point> MapDisplay::points() const {
  std::vector<Point> points;
  points.reserve(settled_.size() + newest_.size());
  const auto take = [&points](const Point& point) { points.push_back(point); };
  settled_.for_each(take);
  newest_.for_each(take);
  return points;
}

}  // namespace fdi_lio::mapping
