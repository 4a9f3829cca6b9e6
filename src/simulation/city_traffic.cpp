#include <cmath>

#include "fdi_lio/simulation/city.hpp"
#include "fdi_lio/simulation/traffic.hpp"

namespace fdi_lio::simulation {

namespace {

/// A car that drives straight through the city in its lane and enters again on the other side.
PoseFunction straight_drive(WorldBuilder* b, const CityGrid& g) {
  Random& r = b->random;
  const bool along_x = r.chance(0.5);
  const std::vector<double>& crossing = along_x ? g.xs : g.ys;
  const std::vector<double>& lines = along_x ? g.ys : g.xs;
  const double line = lines[static_cast<std::size_t>(r.index(static_cast<int>(lines.size())))];
  const double begin = crossing.front() - 50.0;
  const double length = crossing.back() + 50.0 - begin;
  const double direction = r.chance(0.5) ? 1.0 : -1.0;
  const double speed = r.uniform(7.0, 13.0);
  const double start = r.uniform(0.0, length);
  const Ground ground = g.ground;
  return [=](double t) {
    const double way = std::fmod(start + speed * t, length);
    const double along = direction > 0.0 ? begin + way : begin + length - way;
    const double x = along_x ? along : line + direction * kLaneOffset;
    const double y = along_x ? line - direction * kLaneOffset : along;
    const double heading = (along_x ? 0.0 : M_PI / 2.0) + (direction > 0.0 ? 0.0 : M_PI);
    return pose_at(x, y, ground(x, y), heading);
  };
}

PoseFunction pavement_walk(WorldBuilder* b, const CityGrid& g) {
  Random& r = b->random;
  const auto i = static_cast<std::size_t>(r.index(static_cast<int>(g.xs.size()) - 1));
  const auto j = static_cast<std::size_t>(r.index(static_cast<int>(g.ys.size()) - 1));
  const double inset = r.uniform(0.9, g.pavement - 0.5);
  const double x0 = g.xs[i] + g.half_x[i] + inset, x1 = g.xs[i + 1] - g.half_x[i + 1] - inset;
  const double y0 = g.ys[j] + g.half_y[j] + inset, y1 = g.ys[j + 1] - g.half_y[j + 1] - inset;
  Eigen::Vector2d a(x0, y0), c(x1, y0);
  switch (r.index(4)) {
    case 0:
      break;
    case 1:
      a = {x1, y0}, c = {x1, y1};
      break;
    case 2:
      a = {x1, y1}, c = {x0, y1};
      break;
    default:
      a = {x0, y1}, c = {x0, y0};
  }
  const Eigen::Vector3d from(a.x(), a.y(), 0.0), to(c.x(), c.y(), 0.0);
  const PoseFunction flat = walk_between(from, to, r.uniform(0.8, 1.7), r.uniform());
  const Ground ground = g.ground;
  const double kerb = g.kerb;
  return [=](double t) {
    Eigen::Isometry3d pose = flat(t);
    pose.translation().z() = ground(pose.translation().x(), pose.translation().y()) + kerb;
    return pose;
  };
}

}  // namespace

void add_city_traffic(WorldBuilder* b, const PropMaterials& m, const CityGrid& g, const Route& route,
                      double start, const MotionSettings& motion, const Trajectory& trajectory) {
  constexpr double kCarDistance = 3.2;  // cars in the other lane pass at 3.4 m
  constexpr double kWalkerDistance = 1.5;
  constexpr int kTries = 8;
  if (b->settings.cars > 1) {
    for (const double gap : {b->random.uniform(11.0, 20.0), -b->random.uniform(11.0, 18.0)}) {
      const PoseFunction pose = convoy_drive(route, motion, g.ground, trajectory.duration_s(), start + gap);
      if (!comes_near(pose, trajectory, 6.0))
        b->add_object(make_moving_car(b, m, draw_car_kind(&b->random), pose));
    }
  }
  for (int i = 2; i < b->settings.cars; ++i) {
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const PoseFunction pose = straight_drive(b, g);
      if (comes_near(pose, trajectory, kCarDistance)) continue;
      b->add_object(make_moving_car(b, m, draw_car_kind(&b->random), pose));
      break;
    }
  }
  const WalkerShapes shapes(b, m);
  for (int i = 0; i < b->settings.walkers; ++i) {
    const PoseFunction pose = pavement_walk(b, g);
    if (!comes_near(pose, trajectory, kWalkerDistance)) b->add_object(shapes.make(1.3, &b->random, pose));
  }
}

}  // namespace fdi_lio::simulation
