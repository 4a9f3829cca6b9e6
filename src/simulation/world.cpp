#include "fdi_lio/simulation/world.hpp"

#include <cmath>
#include <utility>

namespace fdi_lio::simulation {

namespace {

Eigen::Isometry3d part_pose(const MovingPart& part, double t) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(part.hinge);
  if (part.swing_rad != 0.0) {
    const double angle = part.swing_rad * std::sin(2.0 * M_PI * part.swing_hz * t + part.swing_phase_rad);
    pose.rotate(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()));
  }
  return pose;
}

/// Whether the ray comes nearer to the object's centre than its radius.
bool passes(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, const PosedObject& object) {
  const Eigen::Vector3f to_centre = object.centre - origin;
  const float along = to_centre.dot(direction);
  if (along < 0.0f) return to_centre.squaredNorm() < object.radius_squared;
  return to_centre.squaredNorm() - along * along < object.radius_squared;
}

Hit intersect_objects(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float min_range,
                      float max_range, const std::vector<PosedObject>& objects) {
  Hit nearest;
  for (const PosedObject& object : objects) {
    if (!passes(origin, direction, object)) continue;
    for (const PosedObject::Part& part : object.parts) {
      const float limit = nearest.range > 0.0f ? nearest.range : max_range;
      const Eigen::Vector3f turned = part.T_part_map.linear() * direction;
      Hit hit = part.shape->intersect(part.T_part_map * origin, turned, min_range, limit);
      if (hit.range < 0.0f) continue;
      hit.normal = part.T_part_map.linear().transpose() * hit.normal;
      hit.object = object.id;
      nearest = hit;
    }
  }
  return nearest;
}

PosedObject posed(const MovingObject& object, double t) {
  PosedObject result;
  const Eigen::Isometry3d T_map_object = object.T_map_object(t);
  result.id = object.id;
  result.centre = (T_map_object * object.centre).cast<float>();
  result.radius_squared = static_cast<float>(object.radius_m * object.radius_m);
  for (const MovingPart& part : object.parts) {
    result.parts.push_back({part.shape.get(), (T_map_object * part_pose(part, t)).inverse().cast<float>()});
  }
  return result;
}

}  // namespace

World::World(Mesh static_mesh, std::vector<Material> materials, std::vector<MovingObject> objects)
    : static_mesh_(std::move(static_mesh)), materials_(std::move(materials)), objects_(std::move(objects)) {}

void World::intersect(const RayPacket& rays, float max_range, const std::vector<PosedObject>& objects,
                      Hit* hits) const {
  static_mesh_.intersect(rays, max_range, hits);
  if (objects.empty()) return;
  for (std::size_t i = 0; i < rays.count; ++i) {
    const float limit = hits[i].range > 0.0f ? hits[i].range : max_range;
    const Hit moving = intersect_objects(rays.origin, rays.directions[i], 0.0f, limit, objects);
    if (moving.range > 0.0f) hits[i] = moving;
  }
}

Hit World::intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float min_range,
                     float max_range, const std::vector<PosedObject>& objects) const {
  const Hit fixed = static_mesh_.intersect(origin, direction, min_range, max_range);
  if (objects.empty()) return fixed;
  const float limit = fixed.range > 0.0f ? fixed.range : max_range;
  const Hit moving = intersect_objects(origin, direction, min_range, limit, objects);
  return moving.range > 0.0f ? moving : fixed;
}

std::vector<NearObject> World::objects_near(const Eigen::Vector3d& origin, double t, double duration,
                                            double max_range) const {
  constexpr double kMarginM = 10.0;  // way that sensor and object can make within one scan
  std::vector<NearObject> near;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    NearObject object;
    object.index = static_cast<int>(i);
    object.centre_begin = objects_[i].T_map_object(t) * objects_[i].centre;
    object.centre_end = objects_[i].T_map_object(t + duration) * objects_[i].centre;
    if ((object.centre_begin - origin).norm() < max_range + objects_[i].radius_m + kMarginM)
      near.push_back(object);
  }
  return near;
}

std::vector<PosedObject> World::objects_in_column(const Eigen::Vector3d& origin,
                                                  const Eigen::Vector3d& forward, double t, double share,
                                                  const std::vector<NearObject>& near) const {
  constexpr double kFanMargin = 0.08;  // radians: beam azimuth offsets, divergence and tilt of the sensor
  constexpr double kWayMargin = 0.3;   // metres: what the straight line between begin and end leaves out
  std::vector<PosedObject> selected;
  for (const NearObject& candidate : near) {
    const MovingObject& object = objects_[static_cast<std::size_t>(candidate.index)];
    const Eigen::Vector3d centre = (1.0 - share) * candidate.centre_begin + share * candidate.centre_end;
    const Eigen::Vector3d to_object = centre - origin;
    const double reach = object.radius_m + kWayMargin + kFanMargin * to_object.norm();
    const double ahead = to_object.dot(forward);
    const double aside = std::abs(to_object.x() * forward.y() - to_object.y() * forward.x());
    if (ahead > -reach && aside < reach) selected.push_back(posed(object, t));
  }
  return selected;
}

}  // namespace fdi_lio::simulation
