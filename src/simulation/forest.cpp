#include <algorithm>
#include <cmath>

#include "fdi_lio/simulation/city.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

Route draw_path(double size, Random* r) {
  std::vector<Eigen::Vector2d> corners;
  constexpr int kCorners = 11;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2.0 * M_PI * i / kCorners;
    const double share = r->uniform(0.6, 1.0);
    corners.emplace_back(share * 0.5 * size * std::cos(angle), share * 0.38 * size * std::sin(angle));
  }
  return Route(corners, 9.0, true);
}

/// Rolling ground with bumps that fade on the path.
Ground make_forest_ground(const WorldSettings& settings, const Route& path, Random* r) {
  const Ground rolling = make_rolling_ground(settings.rolling_m, r);
  const auto seed = static_cast<std::uint32_t>(r->next());
  const double rough = settings.relief;
  std::vector<Eigen::Vector2d> points;
  for (double s = 0.0; s < path.length(); s += 2.0) points.push_back(path.at(s).position);
  return [=](double x, double y) {
    double nearest = 1e9;
    for (const Eigen::Vector2d& p : points)
      nearest = std::min(nearest, (p - Eigen::Vector2d(x, y)).squaredNorm());
    const double off_path = std::clamp((std::sqrt(nearest) - 1.2) / 3.0, 0.0, 1.0);
    const double bumps =
        fractal_noise(static_cast<float>(x / 5.0), static_cast<float>(y / 5.0), 3, seed) - 0.5;
    const double fine =
        smooth_noise(static_cast<float>(x / 1.3), static_cast<float>(y / 1.3), seed + 5) - 0.5;
    return rolling(x, y) + rough * ((0.1 + 1.0 * off_path) * bumps + (0.04 + 0.2 * off_path) * fine);
  };
}

/// Spruce: straight trunk, dead twigs below, whorls of hanging branches above.
void add_conifer(WorldBuilder* b, const PropMaterials& m, const Eigen::Vector3d& foot, double height) {
  Random& r = b->random;
  const double girth = 0.008 * height + r.uniform(0.03, 0.1);
  const Eigen::Vector3d top = foot + Eigen::Vector3d(r.uniform(-0.4, 0.4), r.uniform(-0.4, 0.4), height);
  add_tube(&b->mesh, foot - Eigen::Vector3d(0, 0, 0.4), top, girth, 0.03, 7, m.bark);
  const double bare = r.uniform(0.15, 0.45);
  for (double share = 0.1; share < 0.97; share += 0.05) {
    const bool dead = share < bare;
    const int branches = dead ? 2 : 5;
    for (int i = 0; i < branches; ++i) {
      const double angle = r.uniform(0.0, 2.0 * M_PI);
      const double length = dead ? r.uniform(0.3, 0.9) : (1.0 - share) * height * r.uniform(0.14, 0.2) + 0.2;
      const Eigen::Vector3d out(std::cos(angle), std::sin(angle), 0.0), side(-out.y(), out.x(), 0.0);
      const Eigen::Vector3d root = foot + share * (top - foot);
      const Eigen::Vector3d tip = root + length * out - Eigen::Vector3d(0, 0, 0.35 * length);
      const double width = dead ? 0.02 : 0.22 * length;
      add_quad(&b->mesh, root, root + 0.6 * (tip - root) + width * side, tip,
               root + 0.6 * (tip - root) - width * side, dead ? m.bark : m.leaves);
    }
  }
}

void add_undergrowth(WorldBuilder* b, const PropMaterials& m, const Eigen::Vector3d& foot) {
  Random& r = b->random;
  if (r.chance(0.15)) {
    add_ellipsoid(&b->mesh, foot, {r.uniform(0.2, 0.8), r.uniform(0.2, 0.8), r.uniform(0.15, 0.5)}, 7,
                  m.concrete);  // boulder
    return;
  }
  if (r.chance(0.12)) {
    const Eigen::Vector3d along(r.uniform(-4.0, 4.0), r.uniform(-4.0, 4.0), r.uniform(0.0, 0.8));
    add_tube(&b->mesh, foot, foot + along, 0.18, 0.1, 7, m.bark);  // fallen trunk
    return;
  }
  for (int i = 0; i < 14; ++i) {
    const Eigen::Vector3d at = foot + Eigen::Vector3d(r.uniform(-0.5, 0.5), r.uniform(-0.5, 0.5), 0.0);
    const Eigen::Vector3d up(r.uniform(-0.25, 0.25), r.uniform(-0.25, 0.25), r.uniform(0.2, 0.7));
    const Eigen::Vector3d side(r.uniform(-0.12, 0.12), r.uniform(-0.12, 0.12), 0.0);
    add_quad(&b->mesh, at, at + side, at + side + up, at + up, m.leaves);
  }
}

void add_terrain(WorldBuilder* b, const Ground& ground, double half_x, double half_y) {
  constexpr double kNode = 0.8;
  Material soil;
  soil.texture = Texture::kMottled;
  soil.reflectivity = 0.3f;
  soil.contrast = 0.5f;
  soil.scale_m = 0.9f;
  const int columns = static_cast<int>(2.0 * half_x / kNode), rows = static_cast<int>(2.0 * half_y / kNode);
  add_grid(&b->mesh, columns, rows, b->add_material(soil), [&](int column, int row) {
    const double x = -half_x + 2.0 * half_x * column / columns, y = -half_y + 2.0 * half_y * row / rows;
    return SurfacePoint{{x, y, ground(x, y)}, {x, y}};
  });
}

void plant(WorldBuilder* b, const PropMaterials& m, const Ground& ground, const Route& path, double half_x,
           double half_y) {
  Random& r = b->random;
  const double conifers = r.uniform(0.2, 0.9);
  const int count =
      static_cast<int>(4.0 * half_x * half_y / 16.0 * b->settings.trees);  // one per 16 square metres
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d p(r.uniform(-half_x, half_x), r.uniform(-half_y, half_y));
    double nearest = 1e9;
    for (double s = 0.0; s < path.length(); s += 1.0)
      nearest = std::min(nearest, (path.at(s).position - p).squaredNorm());
    if (nearest < 1.9 * 1.9) continue;
    const Eigen::Vector3d foot(p.x(), p.y(), ground(p.x(), p.y()));
    if (r.chance(0.55)) {
      add_undergrowth(b, m, foot);
    } else if (r.chance(conifers)) {
      add_conifer(b, m, foot, r.uniform(6.0, 20.0));
    } else {
      add_tree(b, m, foot, r.uniform(6.0, 15.0));
    }
  }
}

}  // namespace

Place make_forest(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const double size = scenario.world.length_m;
  const Route path = draw_path(size, &b.random);
  const Ground ground = make_forest_ground(scenario.world, path, &b.random);
  const double half_x = 0.5 * size + 30.0, half_y = 0.38 * size + 30.0;
  add_terrain(&b, ground, half_x, half_y);
  plant(&b, materials, ground, path, half_x, half_y);
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(path, ground, scenario.motion, 0.0, scenario.duration_s, seed));
  const WalkerShapes shapes(&b, materials);
  for (int i = 0; i < scenario.world.walkers; ++i) {
    const Route::Point p = path.at(b.random.uniform(0.0, path.length()));
    const Eigen::Vector3d from(p.position.x(), p.position.y(), 0.0);
    const PoseFunction flat =
        walk_between(from, from + 12.0 * Eigen::Vector3d(std::cos(p.heading), std::sin(p.heading), 0.0), 1.2,
                     b.random.uniform());
    const PoseFunction pose = [flat, ground](double t) {
      Eigen::Isometry3d T = flat(t);
      T.translation().z() = ground(T.translation().x(), T.translation().y());
      return T;
    };
    if (!comes_near(pose, *place.trajectory, 1.2)) b.add_object(shapes.make(1.2, &b.random, pose));
  }
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
