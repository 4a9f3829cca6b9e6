#include "fdi_lio/simulation/mesh.hpp"

#include <cmath>

namespace fdi_lio::simulation {

namespace {

std::uint32_t add_vertex(Mesh* mesh, const Eigen::Vector3d& position, const Eigen::Vector2d& uv) {
  mesh->vertices.push_back(position.cast<float>());
  mesh->uvs.push_back(uv.cast<float>());
  return static_cast<std::uint32_t>(mesh->vertices.size() - 1);
}

void add_triangle(Mesh* mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, MaterialId material) {
  mesh->triangles.push_back({a, b, c});
  mesh->materials.push_back(material);
}

}  // namespace

void Mesh::append(const Mesh& other, const Eigen::Isometry3d& T_this_other) {
  const auto offset = static_cast<std::uint32_t>(vertices.size());
  for (const Eigen::Vector3f& vertex : other.vertices) {
    vertices.push_back((T_this_other * vertex.cast<double>()).cast<float>());
  }
  uvs.insert(uvs.end(), other.uvs.begin(), other.uvs.end());
  for (const auto& triangle : other.triangles) {
    triangles.push_back({triangle[0] + offset, triangle[1] + offset, triangle[2] + offset});
  }
  materials.insert(materials.end(), other.materials.begin(), other.materials.end());
}

void add_quad(Mesh* mesh, const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
              const Eigen::Vector3d& d, MaterialId material, const Eigen::Vector2d& uv_origin) {
  const double along = (b - a).norm();
  const double across = (d - a).norm();
  const std::uint32_t ia = add_vertex(mesh, a, uv_origin);
  const std::uint32_t ib = add_vertex(mesh, b, uv_origin + Eigen::Vector2d(along, 0.0));
  const std::uint32_t ic = add_vertex(mesh, c, uv_origin + Eigen::Vector2d(along, across));
  const std::uint32_t id = add_vertex(mesh, d, uv_origin + Eigen::Vector2d(0.0, across));
  add_triangle(mesh, ia, ib, ic, material);
  add_triangle(mesh, ia, ic, id, material);
}

void add_grid(Mesh* mesh, int columns, int rows, MaterialId material,
              const std::function<SurfacePoint(int, int)>& node) {
  const auto first = static_cast<std::uint32_t>(mesh->vertices.size());
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const SurfacePoint point = node(column, row);
      add_vertex(mesh, point.position, point.uv);
    }
  }
  const auto stride = static_cast<std::uint32_t>(columns + 1);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const std::uint32_t a =
          first + static_cast<std::uint32_t>(row) * stride + static_cast<std::uint32_t>(column);
      add_triangle(mesh, a, a + 1, a + stride + 1, material);
      add_triangle(mesh, a, a + stride + 1, a + stride, material);
    }
  }
}

void add_box(Mesh* mesh, const Eigen::Isometry3d& T_mesh_box, const Eigen::Vector3d& size,
             MaterialId material) {
  const Eigen::Vector3d h = 0.5 * size;
  const auto corner = [&](int x, int y, int z) {
    return Eigen::Vector3d(T_mesh_box * Eigen::Vector3d(x * h.x(), y * h.y(), z * h.z()));
  };
  add_quad(mesh, corner(-1, -1, -1), corner(1, -1, -1), corner(1, -1, 1), corner(-1, -1, 1), material);
  add_quad(mesh, corner(1, 1, -1), corner(-1, 1, -1), corner(-1, 1, 1), corner(1, 1, 1), material);
  add_quad(mesh, corner(1, -1, -1), corner(1, 1, -1), corner(1, 1, 1), corner(1, -1, 1), material);
  add_quad(mesh, corner(-1, 1, -1), corner(-1, -1, -1), corner(-1, -1, 1), corner(-1, 1, 1), material);
  add_quad(mesh, corner(-1, -1, 1), corner(1, -1, 1), corner(1, 1, 1), corner(-1, 1, 1), material);
  add_quad(mesh, corner(-1, 1, -1), corner(1, 1, -1), corner(1, -1, -1), corner(-1, -1, -1), material);
}

void add_tube(Mesh* mesh, const Eigen::Vector3d& base, const Eigen::Vector3d& top, double base_radius,
              double top_radius, int segments, MaterialId material, bool capped) {
  const Eigen::Vector3d axis = (top - base).normalized();
  const Eigen::Vector3d side = axis.unitOrthogonal();
  const Eigen::Vector3d other = axis.cross(side);
  const double length = (top - base).norm();
  const int rows = capped ? 3 : 1;
  add_grid(mesh, segments, rows, material, [&](int column, int row) {
    const double angle = 2.0 * M_PI * column / segments;
    const bool at_top = capped ? row >= 2 : row == 1;
    const bool pole = capped && (row == 0 || row == rows);
    const double radius = pole ? 0.0 : (at_top ? top_radius : base_radius);
    const Eigen::Vector3d radial = std::cos(angle) * side + std::sin(angle) * other;
    const Eigen::Vector3d position = (at_top ? top : base) + radius * radial;
    return SurfacePoint{position, {angle * base_radius, at_top ? length : 0.0}};
  });
}

void add_ellipsoid(Mesh* mesh, const Eigen::Vector3d& centre, const Eigen::Vector3d& radii, int segments,
                   MaterialId material) {
  const int rows = segments / 2;
  add_grid(mesh, segments, rows, material, [&](int column, int row) {
    const double azimuth = 2.0 * M_PI * column / segments;
    const double elevation = M_PI * (static_cast<double>(row) / rows - 0.5);
    const Eigen::Vector3d unit(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    return SurfacePoint{centre + radii.cwiseProduct(unit), {azimuth * radii.x(), elevation * radii.z()}};
  });
}

Eigen::Isometry3d pose_at(double x, double y, double z, double yaw) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(Eigen::Vector3d(x, y, z));
  pose.rotate(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  return pose;
}

}  // namespace fdi_lio::simulation
