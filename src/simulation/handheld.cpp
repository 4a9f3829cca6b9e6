#include <algorithm>
#include <cmath>

#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/wall_panels.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kStepHeight = 0.17;  // metres, as in building codes
constexpr double kStepDepth = 0.29;
constexpr int kSteps = 12;

/// A hall with a gallery level: the floor rises over a flight of stairs at `stairs_x` along x.
struct Hall {
  double half_x, half_y, height, stairs_x;

  double upper() const { return kSteps * kStepHeight; }
  double floor(double x) const {
    return std::clamp(std::floor((x - stairs_x) / kStepDepth) + 1.0, 0.0, static_cast<double>(kSteps)) *
           kStepHeight;
  }
  /// Where a person's body goes: a ramp over the stairs.
  double body(double x) const {
    return std::clamp((x - stairs_x) / (kSteps * kStepDepth), 0.0, 1.0) * upper();
  }
};

void add_shell(WorldBuilder* b, const Hall& h, const WallStyle& style) {
  Material floor;
  floor.texture = Texture::kTiles;
  floor.reflectivity = 0.4f;
  floor.contrast = 0.25f;
  floor.scale_m = static_cast<float>(b->random.uniform(0.4, 0.9));
  const MaterialId tiles = b->add_material(floor);
  const double top = h.stairs_x + kSteps * kStepDepth;
  add_quad(&b->mesh, {-h.half_x, -h.half_y, 0}, {h.stairs_x, -h.half_y, 0}, {h.stairs_x, h.half_y, 0},
           {-h.half_x, h.half_y, 0}, tiles);
  add_quad(&b->mesh, {top, -h.half_y, h.upper()}, {h.half_x, -h.half_y, h.upper()},
           {h.half_x, h.half_y, h.upper()}, {top, h.half_y, h.upper()}, tiles);
  for (int i = 0; i < kSteps; ++i) {
    const double x = h.stairs_x + i * kStepDepth, z = i * kStepHeight;
    const double next = x + kStepDepth, up = z + kStepHeight;
    add_quad(&b->mesh, {x, -h.half_y, z}, {x, h.half_y, z}, {x, h.half_y, up}, {x, -h.half_y, up}, tiles);
    add_quad(&b->mesh, {x, -h.half_y, up}, {next, -h.half_y, up}, {next, h.half_y, up}, {x, h.half_y, up},
             tiles);
  }
  add_quad(&b->mesh, {-h.half_x, -h.half_y, h.height}, {h.half_x, -h.half_y, h.height},
           {h.half_x, h.half_y, h.height}, {-h.half_x, h.half_y, h.height}, style.wall);
  add_indoor_wall(b, style, {h.half_x, -h.half_y}, {-h.half_x, -h.half_y});
  add_indoor_wall(b, style, {-h.half_x, -h.half_y}, {-h.half_x, h.half_y});
  add_indoor_wall(b, style, {-h.half_x, h.half_y}, {h.half_x, h.half_y});
  add_indoor_wall(b, style, {h.half_x, h.half_y}, {h.half_x, -h.half_y});
}

void add_furniture(WorldBuilder* b, const PropMaterials& m, const Hall& h, const Route& way,
                   const WallStyle& style) {
  Random& r = b->random;
  for (double x = -h.half_x + 4.0; x < h.half_x - 2.0; x += 6.0) {
    for (const double y : {-0.42 * h.half_y, 0.42 * h.half_y}) {
      add_tube(&b->mesh, {x, y, 0.0}, {x, y, h.height}, 0.28, 0.28, 14, m.concrete);
      add_box(&b->mesh, pose_at(x, y, h.height - 0.25), Eigen::Vector3d(0.4, 1.7 * h.half_y, 0.5),
              m.concrete);  // beam
    }
  }
  const int count = static_cast<int>(45 * b->settings.relief);
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p(r.uniform(-h.half_x + 1, h.half_x - 1), r.uniform(-h.half_y + 1, h.half_y - 1));
    double nearest = 1e9;
    for (double s = 0.0; s < way.length(); s += 0.5)
      nearest = std::min(nearest, (way.at(s).position - p).norm());
    if (nearest < 1.6 || std::abs(p.x() - h.stairs_x - 1.8) < 3.2) continue;
    const double z = h.floor(p.x()), yaw = r.uniform(0.0, M_PI);
    switch (r.index(4)) {
      case 0: {  // table
        add_box(&b->mesh, pose_at(p.x(), p.y(), z + 0.74, yaw), Eigen::Vector3d(1.4, 0.8, 0.04), m.bark);
        for (const double dx : {-0.6, 0.6}) {
          const Eigen::Vector3d leg = pose_at(p.x(), p.y(), z, yaw) * Eigen::Vector3d(dx, 0.0, 0.0);
          add_box(&b->mesh, pose_at(leg.x(), leg.y(), z + 0.37, yaw), Eigen::Vector3d(0.05, 0.7, 0.72),
                  m.metal);
        }
        break;
      }
      case 1:
        add_box(&b->mesh, pose_at(p.x(), p.y(), z + 0.9, yaw), Eigen::Vector3d(r.uniform(0.8, 2.0), 0.4, 1.8),
                style.frame);
        break;
      case 2:
        add_box(&b->mesh, pose_at(p.x(), p.y(), z + 0.35, yaw), Eigen::Vector3d(0.7, 0.6, 0.7), m.bark);
        break;
      default:
        add_box(&b->mesh, pose_at(p.x(), p.y(), z + 1.0, yaw), Eigen::Vector3d(1.4, 0.06, 2.0), style.poster);
    }
  }
}

}  // namespace

Place make_handheld(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const WorldSettings& w = scenario.world;
  const Hall hall{0.5 * w.length_m * b.random.uniform(0.9, 1.1), 0.5 * w.width_m * b.random.uniform(0.9, 1.1),
                  w.height_m, b.random.uniform(-0.1, 0.1) * w.length_m};
  WallStyle style = draw_wall_style(&b, w.height_m);
  style.glass_share = 0.05;
  const double x = 0.72 * hall.half_x, y = 0.68 * hall.half_y;
  const Route way({{-x, -y}, {0.0, -0.8 * y}, {x, -y}, {x, 0.0}, {x, y}, {0.0, 0.9 * y}, {-x, y}, {-x, 0.0}},
                  1.5, true);
  add_shell(&b, hall, style);
  add_furniture(&b, materials, hall, way, style);
  const Ground ground = [hall](double px, double) { return hall.body(px); };
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(way, ground, scenario.motion, 1.0, scenario.duration_s, seed));
  const WalkerShapes shapes(&b, materials);
  for (int i = 0; i < w.walkers; ++i) {
    const double px = b.random.uniform(-0.9, 0.5) * hall.half_x,
                 py = b.random.uniform(-0.9, 0.9) * hall.half_y;
    const bool below = px + 6.0 < hall.stairs_x;
    const Eigen::Vector3d from(px, py, hall.floor(px));
    if (!below && px < hall.stairs_x + 4.0) continue;
    const PoseFunction pose =
        walk_between(from, from + Eigen::Vector3d(below ? 5.0 : 0.5, 1.5, 0.0), 1.0, b.random.uniform());
    if (!comes_near(pose, *place.trajectory, 0.9)) b.add_object(shapes.make(1.0, &b.random, pose));
  }
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
