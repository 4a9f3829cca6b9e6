#pragma once

#include <cstddef>
#include <memory>

#include <Eigen/Core>

#include "fdi_lio/simulation/mesh.hpp"

namespace fdi_lio::simulation {

constexpr std::size_t kPacketSize = 16;

/// Where a ray first meets a mesh.
struct Hit {
  float range = -1.0f;                                ///< metres; negative: nothing met
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  ///< unit, in the frame of the ray, either side
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();       ///< texture coordinates, metres
  MaterialId material = 0;
  std::int16_t object = 0;  ///< 0: static world, otherwise the moving object's id
};

/// Up to 16 rays that start in the same place; directions are unit vectors.
struct RayPacket {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  std::size_t count = 0;
  Eigen::Vector3f directions[kPacketSize];
};

/// A mesh in an Embree acceleration structure. Immutable; may be used from many threads.
class RayMesh {
 public:
  explicit RayMesh(Mesh mesh);
  ~RayMesh();
  RayMesh(RayMesh&&) noexcept;
  RayMesh& operator=(RayMesh&&) noexcept;

  /// First hits of the rays of a packet between 0 and `max_range` metres.
  void intersect(const RayPacket& rays, float max_range, Hit* hits) const;

  /// First hit of one ray between `min_range` and `max_range` metres.
  Hit intersect(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction, float min_range,
                float max_range) const;

  std::size_t triangle_count() const;

  /// Largest distance of a vertex from the mesh's origin, metres.
  double radius() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi_lio::simulation
