#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace fdi_lio::simulation {

using MaterialId = std::uint16_t;

/// Triangles with texture coordinates (metres) and one material each.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector2f> uvs;  ///< one a vertex
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<MaterialId> materials;  ///< one a triangle

  /// Adds the triangles of `other`, moved by `T_this_other`.
  void append(const Mesh& other, const Eigen::Isometry3d& T_this_other);
};

/// Point and texture coordinates of a grid's node.
struct SurfacePoint {
  Eigen::Vector3d position;
  Eigen::Vector2d uv;
};

/// Flat quadrilateral a-b-c-d; u runs along a-b, v along a-d, both from `uv_origin`.
void add_quad(Mesh* mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
              const Eigen::Vector3d& d, MaterialId material,
              const Eigen::Vector2d& uv_origin = Eigen::Vector2d::Zero());

/// Surface through (columns + 1) x (rows + 1) nodes given by `node(column, row)`.
void add_grid(Mesh* mesh, int columns, int rows, MaterialId material,
              const std::function<SurfacePoint(int, int)>& node);

/// Box with edges `size` centred at the origin of `T_mesh_box`.
void add_box(Mesh* mesh, const Eigen::Isometry3d& T_mesh_box, const Eigen::Vector3d& size,
             MaterialId material);

/// Cone frustum from `base` to `top`, open at both ends unless `capped`.
void add_tube(Mesh* mesh, const Eigen::Vector3d& base, const Eigen::Vector3d& top, double base_radius,
              double top_radius, int segments, MaterialId material, bool capped = false);

/// Ellipsoid with semi-axes `radii` at `centre`.
void add_ellipsoid(Mesh* mesh, const Eigen::Vector3d& centre, const Eigen::Vector3d& radii, int segments,
                   MaterialId material);

/// Pose at (x, y, z), turned by `yaw` about z.
Eigen::Isometry3d pose_at(double x, double y, double z, double yaw = 0.0);

}  // namespace fdi_lio::simulation
