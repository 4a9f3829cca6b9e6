#include <algorithm>
#include <cmath>

#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/wall_panels.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

using Corners = std::vector<Eigen::Vector2d>;

Corners rectangle(double x0, double x1, double y0, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

void add_walls(WorldBuilder* b, const WallStyle& style, const Corners& corners) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    add_indoor_wall(b, style, corners[i], corners[(i + 1) % corners.size()]);
  }
}

void add_floor_and_ceiling(WorldBuilder* b, double x0, double x1, double y0, double y1, double height) {
  Material floor;
  floor.texture = Texture::kTiles;
  floor.reflectivity = 0.35f;
  floor.contrast = 0.12f;
  floor.scale_m = 0.6f;
  Material ceiling = floor;
  ceiling.reflectivity = 0.7f;
  ceiling.contrast = 0.05f;
  const MaterialId floor_id = b->add_material(floor), ceiling_id = b->add_material(ceiling);
  add_quad(&b->mesh, {x0, y0, 0}, {x1, y0, 0}, {x1, y1, 0}, {x0, y1, 0}, floor_id);
  add_quad(&b->mesh, {x0, y0, height}, {x1, y0, height}, {x1, y1, height}, {x0, y1, height}, ceiling_id);
}

/// Lights along the ceiling, and things that stand at walls here and there.
void furnish(WorldBuilder* b, const PropMaterials& m, const Corners& way, double half_width, double height) {
  Random& r = b->random;
  for (std::size_t i = 0; i < way.size(); ++i) {
    const Eigen::Vector2d a = way[i], along = (way[(i + 1) % way.size()] - a).normalized();
    const double length = (way[(i + 1) % way.size()] - a).norm();
    const double yaw = std::atan2(along.y(), along.x());
    for (double s = 1.5; s < length; s += 3.0) {
      const Eigen::Vector2d p = a + s * along;
      add_box(&b->mesh, pose_at(p.x(), p.y(), height - 0.03, yaw), Eigen::Vector3d(1.2, 0.3, 0.08), m.lamp);
    }
    for (double s = r.uniform(2.0, 12.0); s < length - 2.0; s += r.uniform(8.0, 25.0)) {
      if (!r.chance(b->settings.marks)) continue;
      const double side = r.chance(0.5) ? 1.0 : -1.0;
      const Eigen::Vector2d p =
          a + s * along + side * (half_width - 0.2) * Eigen::Vector2d(-along.y(), along.x());
      if (r.chance(0.5)) {
        add_tube(&b->mesh, {p.x(), p.y(), 0.9}, {p.x(), p.y(), 1.4}, 0.08, 0.08, 8, m.plate,
                 true);  // extinguisher
      } else {
        add_box(&b->mesh, pose_at(p.x(), p.y(), 0.4, yaw), Eigen::Vector3d(r.uniform(0.5, 1.5), 0.35, 0.8),
                m.bark);
      }
    }
  }
}

void add_people(WorldBuilder* b, const PropMaterials& m, const Corners& way, double half_width,
                const Trajectory& own) {
  const WalkerShapes shapes(b, m);
  constexpr int kTries = 20;
  for (int i = 0; i < b->settings.walkers; ++i) {
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const auto side = static_cast<std::size_t>(b->random.index(static_cast<int>(way.size())));
      const Eigen::Vector2d a = way[side], c = way[(side + 1) % way.size()];
      const Eigen::Vector2d along = (c - a).normalized(), left(-along.y(), along.x());
      const double aside = b->random.uniform(-half_width + 0.45, half_width - 0.45);
      const double from = b->random.uniform(0.0, 0.6), to = from + b->random.uniform(0.2, 0.4);
      const Eigen::Vector2d p = a + from * (c - a) + aside * left, q = a + to * (c - a) + aside * left;
      const PoseFunction pose = walk_between({p.x(), p.y(), 0.0}, {q.x(), q.y(), 0.0},
                                             b->random.uniform(0.8, 1.6), b->random.uniform());
      if (comes_near(pose, own, 0.75)) continue;
      b->add_object(shapes.make(1.2, &b->random, pose));
      break;
    }
  }
}

}  // namespace

Place make_corridor(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const double half = 0.5 * scenario.world.width_m, height = scenario.world.height_m;
  const double x1 = scenario.world.length_m * b.random.uniform(0.9, 1.1);
  const double y1 = scenario.world.length_m * b.random.uniform(0.4, 0.6);
  const WallStyle style = draw_wall_style(&b, height);
  Corners outer = rectangle(-half, x1 + half, -half, y1 + half);
  std::reverse(outer.begin(), outer.end());  // the corridor is on the right of each wall
  add_walls(&b, style, outer);
  add_walls(&b, style, rectangle(half, x1 - half, half, y1 - half));
  add_floor_and_ceiling(&b, -half - 5.0, x1 + half + 5.0, -half - 5.0, y1 + half + 5.0, height);
  Corners way = rectangle(0.0, x1, 0.0, y1);
  furnish(&b, materials, way, half, height);
  if (b.random.chance(0.5)) std::reverse(way.begin(), way.end());
  const Route route(way, 1.2, true);
  const Ground level = [](double, double) { return 0.0; };
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(route, level, scenario.motion, 5.0, scenario.duration_s, seed));
  add_people(&b, materials, way, half, *place.trajectory);
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
