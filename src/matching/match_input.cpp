#include "fdi_lio/matching/match_input.hpp"

#include <cmath>
#include <cstdint>

#include "fdi_lio/common/key_index.hpp"

namespace fdi_lio::matching {

namespace {

/// The mean of the points in each voxel, in the order of their first ones. Which point comes first into a
/// voxel depends on its noise (see `select_planes`), so that none of them may stand for all.
std::vector<Eigen::Vector3d> downsample(const std::vector<Eigen::Vector3d>& points, double voxel_m) {
  std::vector<Eigen::Vector3d> means;
  std::vector<std::uint32_t> counts;
  KeyIndex seen;
  for (const Eigen::Vector3d& point : points) {
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto cell = static_cast<std::int64_t>(std::floor(point[axis] / voxel_m));
      key = (key << 21) | (static_cast<std::uint64_t>(cell) & 0x1fffff);
    }
    const std::uint32_t voxel = seen.find_or_add(key);
    if (voxel == means.size()) {
      means.emplace_back(Eigen::Vector3d::Zero());
      counts.push_back(0);
    }
    ++counts[voxel];
    means[voxel] += (point - means[voxel]) / counts[voxel];
  }
  return means;
}

std::vector<Eigen::Vector3d> to_body(const std::vector<Point>& points, const Eigen::Isometry3d& T_imu_lidar) {
  std::vector<Eigen::Vector3d> body;
  body.reserve(points.size());
  for (const Point& point : points) body.push_back(T_imu_lidar * point.position.cast<double>());
  return body;
}

}  // namespace

std::vector<Eigen::Vector3d> thin_out(const std::vector<Eigen::Vector3d>& points, std::size_t limit) {
  if (points.size() <= limit) return points;
  std::vector<Eigen::Vector3d> kept;
  kept.reserve(limit);
  for (std::size_t k = 0; k < limit; ++k) kept.push_back(points[k * points.size() / limit]);
  return kept;
}

MatchInput make_match_input(const FeatureSet& features, const MappingConfig& config,
                            const Eigen::Isometry3d& T_imu_lidar, double feature_voxel_m) {
  MatchInput input;
  const std::size_t limit = static_cast<std::size_t>(config.max_planes_matched);
  input.planes = thin_out(downsample(to_body(features.planes, T_imu_lidar), feature_voxel_m), limit);
  if (config.use_edges) {
    input.edges = downsample(to_body(features.edges, T_imu_lidar), 0.5 * feature_voxel_m);
  }
  if (config.use_intensity) {
    input.textures = to_body(features.intensity_edges, T_imu_lidar);
    input.levels.reserve(features.intensity_edges.size());
    for (const Point& point : features.intensity_edges) input.levels.push_back(point.intensity);
  }
  input.origin = T_imu_lidar.translation();
  input.spin_axis = T_imu_lidar.linear().col(2);
  return input;
}

}  // namespace fdi_lio::matching
