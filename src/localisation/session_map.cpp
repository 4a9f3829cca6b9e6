#include "fdi_lio/localisation/session_map.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::localisation {

namespace {

/// Places with the most similar ring keys that are compared column by column.
constexpr std::size_t kKeyCandidates = 200;

}  // namespace

SessionMap::SessionMap(mapping::Session session, int cloud_memory_mb)
    : session_(std::move(session)), store_(static_cast<std::size_t>(cloud_memory_mb) << 20) {
  for (std::size_t k = 0; k < size(); ++k) store_.add(mapping::load_session_cloud(session_, k));
}

std::size_t SessionMap::nearest(const Eigen::Vector3d& p_map) const {
  std::size_t nearest = 0;
  for (std::size_t k = 1; k < size(); ++k) {
    if ((T_map_imu(k).translation() - p_map).norm() < (T_map_imu(nearest).translation() - p_map).norm())
      nearest = k;
  }
  return nearest;
}

double SessionMap::height_at(const Eigen::Vector2d& p_map) const {
  const auto distance = [this, &p_map](std::size_t k) {
    return (T_map_imu(k).translation().head<2>() - p_map).norm();
  };
  std::size_t nearest = 0;
  for (std::size_t k = 1; k < size(); ++k)
    if (distance(k) < distance(nearest)) nearest = k;
  return T_map_imu(nearest).translation().z();
}

std::vector<mapping::PlacedCloud> SessionMap::submap(std::size_t center, double radius_m, std::size_t limit) {
  std::vector<std::size_t> near;
  for (std::size_t k = 0; k < size(); ++k)
    if ((T_map_imu(k).translation() - T_map_imu(center).translation()).norm() <= radius_m) near.push_back(k);
  const Eigen::Isometry3d T_center_map = T_map_imu(center).inverse();
  const std::size_t taken = std::min(near.size(), limit);
  std::vector<mapping::PlacedCloud> placed;
  for (std::size_t k = 0; k < taken; ++k) {
    const std::size_t index = near[(2 * k + 1) * near.size() / (2 * taken)];
    placed.push_back({store_.get(index), T_center_map * T_map_imu(index)});
  }
  return placed;
}

std::vector<Point> SessionMap::points(double voxel_m) {
  mapping::MapBuilder map(voxel_m);
  for (std::size_t k = 0; k < size(); ++k) map.add(store_.get(k)->surface, T_map_imu(k));
  return map.points();
}

mapping::PlaceDescriptor SessionMap::describe(const std::vector<Point>& points,
                                              const Eigen::Matrix3d& R_odom_imu) const {
  return mapping::describe_place(points, mapping::levelled(R_odom_imu), session_.descriptor_range_m);
}

std::vector<mapping::AlikePlace> SessionMap::alike(const mapping::PlaceDescriptor& place, double max_distance,
                                                   std::size_t limit, double apart_m) const {
  std::vector<std::size_t> all(size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  mapping::AlikeSearch search;
  search.max_distance = max_distance;
  search.limit = limit;
  search.key_candidates = kKeyCandidates;
  search.is_same = [this, apart_m](std::size_t a, std::size_t b) {
    return (T_map_imu(a).translation() - T_map_imu(b).translation()).norm() < apart_m;
  };
  return mapping::most_alike(session_.places, all, place, search);
}

Eigen::Matrix3d SessionMap::turned(std::size_t from, double yaw_rad,
                                   const Eigen::Matrix3d& R_odom_imu) const {
  return mapping::rotation_between_places(session_.keyframes[from].T_odom_imu.linear(), yaw_rad, R_odom_imu);
}

}  // namespace fdi_lio::localisation
