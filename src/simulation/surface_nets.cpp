#include "fdi_lio/simulation/surface_nets.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr int kBlock = 8;  // nodes a side that are skipped together
constexpr std::uint32_t kNoVertex = std::numeric_limits<std::uint32_t>::max();

/// Distances at the nodes of a regular grid.
struct Grid {
  Eigen::Vector3i size;
  Eigen::Vector3d origin;
  double cell;
  std::vector<float> values;

  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(size.y()) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(size.x()) +
           static_cast<std::size_t>(x);
  }
  Eigen::Vector3d position(double x, double y, double z) const {
    return origin + cell * Eigen::Vector3d(x, y, z);
  }
};

void fill_block(const SignedDistance& distance, int x0, int y0, int z0, Grid* grid) {
  const double half = 0.5 * kBlock;
  const double centre = distance(grid->position(x0 + half, y0 + half, z0 + half));
  const double reach = 2.0 * std::sqrt(3.0) * half * grid->cell;
  const bool far = std::abs(centre) > reach;
  for (int z = z0; z < std::min(z0 + kBlock, grid->size.z()); ++z) {
    for (int y = y0; y < std::min(y0 + kBlock, grid->size.y()); ++y) {
      for (int x = x0; x < std::min(x0 + kBlock, grid->size.x()); ++x) {
        grid->values[grid->index(x, y, z)] =
            static_cast<float>(far ? centre : distance(grid->position(x, y, z)));
      }
    }
  }
}

Grid sample(const SignedDistance& distance, const Eigen::AlignedBox3d& bounds, double cell) {
  Grid grid;
  grid.cell = cell;
  grid.origin = bounds.min();
  grid.size = (bounds.sizes() / cell).array().ceil().cast<int>() + 1;
  grid.values.resize(grid.index(0, 0, grid.size.z()));
  const int layers = (grid.size.z() + kBlock - 1) / kBlock;
  const int rows = (grid.size.y() + kBlock - 1) / kBlock;
  parallel_chunks(static_cast<std::size_t>(layers * rows), 1, [&](std::size_t i, std::size_t, std::size_t) {
    const int z = static_cast<int>(i) / rows * kBlock, y = static_cast<int>(i) % rows * kBlock;
    for (int x = 0; x < grid.size.x(); x += kBlock) fill_block(distance, x, y, z, &grid);
  });
  return grid;
}

/// Mean of the points where the surface cuts the cell's edges; false if it does not.
bool cell_vertex(const Grid& grid, int x, int y, int z, Eigen::Vector3d* vertex) {
  static constexpr int kEdges[12][2] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3},
                                        {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
  std::array<float, 8> value;
  int inside = 0;
  for (int corner = 0; corner < 8; ++corner) {
    value[static_cast<std::size_t>(corner)] =
        grid.values[grid.index(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2))];
    inside += value[static_cast<std::size_t>(corner)] < 0.0f ? 1 : 0;
  }
  if (inside == 0 || inside == 8) return false;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (const auto& edge : kEdges) {
    const float a = value[static_cast<std::size_t>(edge[0])], b = value[static_cast<std::size_t>(edge[1])];
    if ((a < 0.0f) == (b < 0.0f)) continue;
    const double u = a / (a - b);
    const auto corner = [](int i) { return Eigen::Vector3d(i & 1, i >> 1 & 1, i >> 2); };
    sum += (1.0 - u) * corner(edge[0]) + u * corner(edge[1]);
    ++count;
  }
  const Eigen::Vector3d in_cell = sum / count;
  *vertex = grid.position(x + in_cell.x(), y + in_cell.y(), z + in_cell.z());
  return true;
}

void add_quad_between(Mesh* mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d,
                      MaterialId material) {
  if (a == kNoVertex || b == kNoVertex || c == kNoVertex || d == kNoVertex) return;
  mesh->triangles.push_back({a, b, c});
  mesh->triangles.push_back({a, c, d});
  mesh->materials.push_back(material);
  mesh->materials.push_back(material);
}

}  // namespace

void add_surface(Mesh* mesh, const SignedDistance& distance, const Eigen::AlignedBox3d& bounds, double cell,
                 MaterialId material) {
  const Grid grid = sample(distance, bounds, cell);
  std::vector<std::uint32_t> vertices(grid.values.size(), kNoVertex);
  const auto vertex = [&](int x, int y, int z) { return vertices[grid.index(x, y, z)]; };
  for (int z = 0; z + 1 < grid.size.z(); ++z) {
    for (int y = 0; y + 1 < grid.size.y(); ++y) {
      for (int x = 0; x + 1 < grid.size.x(); ++x) {
        Eigen::Vector3d p;
        if (!cell_vertex(grid, x, y, z, &p)) continue;
        vertices[grid.index(x, y, z)] = static_cast<std::uint32_t>(mesh->vertices.size());
        mesh->vertices.push_back(p.cast<float>());
        mesh->uvs.emplace_back(static_cast<float>(p.x() + 0.6 * p.y()),
                               static_cast<float>(p.z() + 0.7 * p.y()));
      }
    }
  }
  // A quadrilateral for every grid edge that the surface cuts: it joins the four cells round the edge.
  for (int z = 1; z + 1 < grid.size.z(); ++z) {
    for (int y = 1; y + 1 < grid.size.y(); ++y) {
      for (int x = 1; x + 1 < grid.size.x(); ++x) {
        const bool here = grid.values[grid.index(x, y, z)] < 0.0f;
        if (here != (grid.values[grid.index(x + 1, y, z)] < 0.0f)) {
          add_quad_between(mesh, vertex(x, y - 1, z - 1), vertex(x, y, z - 1), vertex(x, y, z),
                           vertex(x, y - 1, z), material);
        }
        if (here != (grid.values[grid.index(x, y + 1, z)] < 0.0f)) {
          add_quad_between(mesh, vertex(x - 1, y, z - 1), vertex(x, y, z - 1), vertex(x, y, z),
                           vertex(x - 1, y, z), material);
        }
        if (here != (grid.values[grid.index(x, y, z + 1)] < 0.0f)) {
          add_quad_between(mesh, vertex(x - 1, y - 1, z), vertex(x, y - 1, z), vertex(x, y, z),
                           vertex(x - 1, y, z), material);
        }
      }
    }
  }
}

}  // namespace fdi_lio::simulation
