#include <algorithm>
#include <cmath>
#include <memory>

#include "fdi_lio/simulation/buildings.hpp"
#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

/// A square with its half sizes, metres; the ground is level.
struct Square {
  double half_x, half_y;
  MaterialId paving;
};

void add_row(WorldBuilder* b, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Eigen::Vector2d along = (to - from).normalized();
  const double length = (to - from).norm();
  for (double s = 0.0; s + 8.0 < length;) {
    const double width = std::min(b->random.uniform(12.0, 26.0), length - s);
    BuildingLot lot;
    lot.front_left = from + s * along;
    lot.front_right = from + (s + width) * along;
    lot.height = b->random.uniform(10.0, 22.0);
    add_building(b, lot);
    s += width + (b->random.chance(0.2) ? b->random.uniform(3.0, 8.0) : 0.0);
  }
}

void add_ground(WorldBuilder* b, const Square& q) {
  const double x = q.half_x + 60.0, y = q.half_y + 60.0;
  add_quad(&b->mesh, {-x, -y, 0.0}, {x, -y, 0.0}, {x, y, 0.0}, {-x, y, 0.0}, q.paving);
}

/// Stepped fountain or monument near the middle, kiosks, trees, lamps and benches.
void add_fittings(WorldBuilder* b, const PropMaterials& m, const Square& q) {
  Random& r = b->random;
  const Eigen::Vector3d middle(r.uniform(-6.0, 6.0), r.uniform(-5.0, 5.0), 0.0);
  for (int step = 0; step < 3; ++step) {
    const double radius = 4.0 - 0.8 * step;
    add_tube(&b->mesh, middle + Eigen::Vector3d(0, 0, 0.2 * step - 0.1),
             middle + Eigen::Vector3d(0, 0, 0.2 * step + 0.2), radius, radius, 24, m.concrete, true);
  }
  add_tube(&b->mesh, middle, middle + Eigen::Vector3d(0, 0, r.uniform(3.0, 7.0)), 0.6, 0.35, 12, m.concrete,
           true);
  const int trees = static_cast<int>(12 * b->settings.trees);
  for (int i = 0; i < trees; ++i) {
    const double side = i % 2 == 0 ? 1.0 : -1.0;
    add_tree(b, m, {r.uniform(-q.half_x, q.half_x), side * (q.half_y - r.uniform(4.0, 7.0)), 0.0},
             r.uniform(5.0, 9.0));
  }
  for (int i = 0; i < 6; ++i) {
    const double angle = 2.0 * M_PI * (i + 0.5) / 6.0;
    add_lamp_post(b, m, {0.85 * q.half_x * std::cos(angle), 0.8 * q.half_y * std::sin(angle), 0.0},
                  angle + M_PI);
  }
  for (int i = 0; i < 14; ++i) {
    const double x = r.uniform(-q.half_x + 3, q.half_x - 3);
    const double side = r.chance(0.5) ? 1.0 : -1.0;
    add_street_furniture(b, m, {x, side * (q.half_y - r.uniform(2.0, 4.0)), 0.0}, r.uniform(0.0, 2.0 * M_PI));
  }
}

/// Round the monument, at a distance that leaves room for people on both sides.
Route draw_way(const Square& q, Random* random) {
  std::vector<Eigen::Vector2d> corners;
  const int count = 7;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.0 * M_PI * i / count;
    const double share = random->uniform(0.45, 0.68);
    corners.emplace_back(share * q.half_x * std::cos(angle), share * q.half_y * std::sin(angle));
  }
  return Route(corners, 5.0, true);
}

/// Somebody who crosses the sensor's surroundings.
PoseFunction crossing_walk(const Route& way, const Square& q, Random* r) {
  const Eigen::Vector2d centre = way.at(r->uniform(0.0, way.length())).position;
  const auto point = [&](double reach) {
    const Eigen::Vector2d p =
        centre + reach * Eigen::Rotation2Dd(r->uniform(0.0, 2.0 * M_PI)).toRotationMatrix().col(0);
    return Eigen::Vector3d(std::clamp(p.x(), 2.0 - q.half_x, q.half_x - 2.0),
                           std::clamp(p.y(), 2.0 - q.half_y, q.half_y - 2.0), 0.0);
  };
  const Eigen::Vector3d a = point(r->uniform(3.0, 16.0)), c = point(r->uniform(6.0, 20.0));
  if ((a - c).norm() < 4.0)
    return walk_between(a, a + Eigen::Vector3d(6.0, 0.0, 0.0), r->uniform(0.7, 1.7), r->uniform());
  return walk_between(a, c, r->uniform(0.7, 1.7), r->uniform());
}

/// Somebody who walks along with the sensor, so that he seems to stand still.
PoseFunction companion_walk(const Trajectory& trajectory, Random* r) {
  const double aside = (r->chance(0.5) ? 1.0 : -1.0) * r->uniform(1.8, 4.5);
  const double ahead = r->uniform(-5.0, 7.0);
  auto shared = std::make_shared<const Trajectory>(trajectory);
  return [=](double t) {
    const Eigen::Isometry3d T = shared->pose(t);
    const double yaw = std::atan2(T.linear()(1, 0), T.linear()(0, 0));
    const Eigen::Vector3d& p = T.translation();
    return pose_at(p.x() + ahead * std::cos(yaw) - aside * std::sin(yaw),
                   p.y() + ahead * std::sin(yaw) + aside * std::cos(yaw), 0.0, yaw);
  };
}

/// A car that circles the square along the houses.
PoseFunction circling_car(const Square& q, Random* r) {
  const double x = q.half_x - 5.0, y = q.half_y - 8.0;
  auto lane = std::make_shared<const Route>(std::vector<Eigen::Vector2d>{{-x, -y}, {x, -y}, {x, y}, {-x, y}},
                                            8.0, true);
  const double start = r->uniform(0.0, lane->length()), speed = r->uniform(3.0, 6.0);
  return [=](double t) {
    const Route::Point p = lane->at(start + speed * t);
    return pose_at(p.position.x(), p.position.y(), 0.0, p.heading);
  };
}

void add_movers(WorldBuilder* b, const PropMaterials& m, const Square& q, const Route& way,
                const Trajectory& own) {
  constexpr double kCompanionShare = 0.12;
  constexpr int kTries = 20;
  const WalkerShapes shapes(b, m);
  for (int i = 0; i < b->settings.walkers; ++i) {
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const bool companion = b->random.chance(kCompanionShare);
      const PoseFunction pose =
          companion ? companion_walk(own, &b->random) : crossing_walk(way, q, &b->random);
      if (comes_near(pose, own, 1.3)) continue;
      b->add_object(shapes.make(1.2, &b->random, pose));
      break;
    }
  }
  for (int i = 0; i < b->settings.cars; ++i) {
    const PoseFunction pose = circling_car(q, &b->random);
    if (!comes_near(pose, own, 3.5)) b->add_object(make_moving_car(b, m, draw_car_kind(&b->random), pose));
  }
}

}  // namespace

Place make_plaza(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  Material slabs;
  slabs.texture = Texture::kTiles;
  slabs.reflectivity = 0.3f;
  slabs.contrast = 0.2f;
  slabs.scale_m = static_cast<float>(b.random.uniform(0.4, 1.2));
  const double size = scenario.world.length_m * b.random.uniform(0.85, 1.15);
  const Square q{0.5 * size, 0.5 * size * b.random.uniform(0.65, 0.9), b.add_material(slabs)};
  add_ground(&b, q);
  const double x = q.half_x, y = q.half_y, corner = 6.0;  // streets leave at the corners
  add_row(&b, {-x + corner, y}, {x - corner, y});
  add_row(&b, {x, y - corner}, {x, -y + corner});
  add_row(&b, {x - corner, -y}, {-x + corner, -y});
  add_row(&b, {-x, -y + corner}, {-x, y - corner});
  add_fittings(&b, materials, q);
  const Route way = draw_way(q, &b.random);
  const Ground level = [](double, double) { return 0.0; };
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(way, level, scenario.motion, 0.0, scenario.duration_s, seed));
  add_movers(&b, materials, q, way, *place.trajectory);
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
