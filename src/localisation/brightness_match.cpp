#include "fdi_lio/localisation/brightness_match.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/voxel_cells.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::localisation {

namespace {

/// Distance of what is taken for the same place [voxels].
constexpr float kSamePlace = 1.25F;
/// Variance of ln(1 + intensity) below which there is no contrast.
constexpr double kNoContrast = 1e-6;

std::vector<Point> surface_of(const std::vector<mapping::PlacedCloud>& clouds, const Eigen::Isometry3d& T,
                              double voxel_m) {
  mapping::MapBuilder builder(voxel_m);
  for (const mapping::PlacedCloud& placed : clouds)
    builder.add(placed.cloud->surface, T * placed.T_submap_imu);
  return builder.points();
}

/// Mean points of a surface, to be found by place. In units of voxels.
class Surface {
 public:
  Surface(std::vector<Point> points, double voxel_m)
      : points_(std::move(points)), scale_(static_cast<float>(1.0 / voxel_m)) {
    for (std::uint32_t number = 0; number < points_.size(); ++number)
      index_.find_or_add(key_of(cell_of(scale_ * points_[number].position)), number);
  }

  /// The nearest point within kSamePlace; null if there is none.
  const Point* nearest(const Eigen::Vector3f& position) const {
    const Eigen::Vector3i cell = cell_of(scale_ * position);
    const float limit_m = kSamePlace / scale_;
    float least_sq = limit_m * limit_m;
    const Point* nearest = nullptr;
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) {
          const std::uint32_t number = index_.find(key_of(cell + Eigen::Vector3i(x, y, z)));
          if (number == KeyIndex::kNone) continue;
          const float distance_sq = (points_[number].position - position).squaredNorm();
          if (distance_sq > least_sq) continue;
          least_sq = distance_sq;
          nearest = &points_[number];
        }
      }
    }
    return nearest;
  }

 private:
  std::vector<Point> points_;
  float scale_;
  KeyIndex index_;  ///< a point's number is its place in `points_`
};

double log_intensity(const Point& point) { return std::log1p(std::max(0.0F, point.intensity)); }

}  // namespace

BrightnessMatch match_brightness(const std::vector<mapping::PlacedCloud>& target,
                                 const std::vector<mapping::PlacedCloud>& source,
                                 const Eigen::Isometry3d& T_target_source, double voxel_m, double radius_m) {
  const Surface surface(surface_of(target, Eigen::Isometry3d::Identity(), voxel_m), voxel_m);
  const Eigen::Vector3f origin = T_target_source.translation().cast<float>();
  std::vector<Eigen::Vector2d> pairs;
  for (const Point& point : surface_of(source, T_target_source, voxel_m)) {
    if ((point.position - origin).norm() > static_cast<float>(radius_m)) continue;
    const Point* neighbour = surface.nearest(point.position);
    if (neighbour != nullptr) pairs.emplace_back(log_intensity(point), log_intensity(*neighbour));
  }
  BrightnessMatch match;
  match.voxels = pairs.size();
  if (pairs.empty()) return match;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& pair : pairs) mean += pair / static_cast<double>(pairs.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& pair : pairs) scatter += (pair - mean) * (pair - mean).transpose();
  scatter /= static_cast<double>(pairs.size());
  if (scatter.diagonal().minCoeff() > kNoContrast)
    match.correlation = scatter(0, 1) / std::sqrt(scatter(0, 0) * scatter(1, 1));
  return match;
}

}  // namespace fdi_lio::localisation
