#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/simulation/material.hpp"
#include "fdi_lio/simulation/mesh.hpp"
#include "fdi_lio/simulation/ray_mesh.hpp"

namespace fdi_lio::simulation {

/// A rigid part of a moving object that may swing like a pendulum about its own y axis (legs, arms).
struct MovingPart {
  std::shared_ptr<const RayMesh> shape;
  Eigen::Vector3d hinge = Eigen::Vector3d::Zero();  ///< origin of the shape in the object's frame, metres
  double swing_rad = 0.0;                           ///< amplitude
  double swing_hz = 0.0;
  double swing_phase_rad = 0.0;
};

/// A car or a person. `T_map_object(t)` is its pose at time t (seconds since the start of the recording).
struct MovingObject {
  std::int16_t id = 0;                               ///< label, > 0
  double radius_m = 1.0;                             ///< of a ball that holds all parts
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< of that ball, in the object's frame, metres
  std::vector<MovingPart> parts;
  std::function<Eigen::Isometry3d(double)> T_map_object;
};

/// A moving object that a scan may meet, with where it is at the begin and end of the scan (map frame,
/// metres).
struct NearObject {
  int index = 0;
  Eigen::Vector3d centre_begin = Eigen::Vector3d::Zero();
  Eigen::Vector3d centre_end = Eigen::Vector3d::Zero();
};

/// A moving object at one instant, ready for ray tests.
struct PosedObject {
  struct Part {
    const RayMesh* shape = nullptr;
    Eigen::Isometry3f T_part_map = Eigen::Isometry3f::Identity();
  };
  std::int16_t id = 0;
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();  ///< map frame
  float radius_squared = 0.0f;
  std::vector<Part> parts;
};

/// The place: a static mesh, materials, and things that move.
class World {
 public:
  World(Mesh static_mesh, std::vector<Material> materials, std::vector<MovingObject> objects);

  /// First hits of rays in map frame, within `max_range` metres, on the static world and on `objects`.
  void intersect(const RayPacket& rays, float max_range, const std::vector<PosedObject>& objects,
                 Hit* hits) const;

  /// First hit of one ray beyond `min_range` metres.
  Hit intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float min_range,
                float max_range, const std::vector<PosedObject>& objects) const;

  /// The moving objects that can be within `max_range` metres of `origin` during [t, t + duration] seconds.
  std::vector<NearObject> objects_near(const Eigen::Vector3d& origin, double t, double duration,
                                       double max_range) const;

  /// Those of `near` that an upright fan of rays from `origin` towards the horizontal unit vector `forward`
  /// can meet, posed at time `t`; `share` is where t lies between the begin and end of the scan, 0 to 1.
  std::vector<PosedObject> objects_in_column(const Eigen::Vector3d& origin, const Eigen::Vector3d& forward,
                                             double t, double share,
                                             const std::vector<NearObject>& near) const;

  const Material& material(MaterialId id) const { return materials_[id]; }
  const std::vector<MovingObject>& objects() const { return objects_; }
  const RayMesh& static_mesh() const { return static_mesh_; }

 private:
  RayMesh static_mesh_;
  std::vector<Material> materials_;
  std::vector<MovingObject> objects_;
};

}  // namespace fdi_lio::simulation
