#include <cmath>

#include "fdi_lio/simulation/city.hpp"

namespace fdi_lio::simulation {

namespace {

/// One side of a block: the kerb from `a` along `along` with the street on the right.
struct Kerb {
  Eigen::Vector2d a;
  Eigen::Vector2d along;
  double length;

  Eigen::Vector2d right() const { return {along.y(), -along.x()}; }
  double yaw() const { return std::atan2(along.y(), along.x()); }
};

Eigen::Vector3d on_pavement(const CityGrid& g, const Eigen::Vector2d& p) {
  return {p.x(), p.y(), g.ground(p.x(), p.y()) + g.kerb};
}

void park_cars(WorldBuilder* b, const PropMaterials& m, const CityGrid& g, const Kerb& kerb) {
  constexpr double kSlot = 6.2;
  Random& r = b->random;
  for (double s = 9.0; s + kSlot < kerb.length - 9.0; s += kSlot) {
    if (!r.chance(b->settings.parked_share)) continue;
    CarKind kind = draw_car_kind(&r);
    if (kind == CarKind::kTruck) kind = CarKind::kVan;
    const Eigen::Vector2d p =
        kerb.a + (s + r.uniform(2.6, 3.4)) * kerb.along + r.uniform(1.05, 1.3) * kerb.right();
    const Eigen::Vector2d nose = p + 1.4 * kerb.along, tail = p - 1.4 * kerb.along;
    const double rise = g.ground(nose.x(), nose.y()) - g.ground(tail.x(), tail.y());
    Eigen::Isometry3d T = pose_at(p.x(), p.y(), g.ground(p.x(), p.y()), kerb.yaw() + r.uniform(-0.03, 0.03));
    T.rotate(Eigen::AngleAxisd(-std::atan2(rise, 2.8), Eigen::Vector3d::UnitY()));
    b->mesh.append(make_car(b, m, kind), T);
  }
}

void plant_trees(WorldBuilder* b, const PropMaterials& m, const CityGrid& g, const Kerb& kerb) {
  Random& r = b->random;
  if (!r.chance(0.5 * b->settings.trees)) return;
  const double spacing = r.uniform(8.0, 14.0);
  for (double s = r.uniform(5.0, 9.0); s < kerb.length - 5.0; s += spacing * r.uniform(0.85, 1.15)) {
    if (r.chance(0.15)) continue;
    add_tree(b, m, on_pavement(g, kerb.a + s * kerb.along - 0.8 * kerb.right()), r.uniform(5.0, 10.0));
  }
}

void furnish_side(WorldBuilder* b, const PropMaterials& m, const CityGrid& g, const Kerb& kerb) {
  Random& r = b->random;
  const Eigen::Vector2d right = kerb.right();
  const double to_street = std::atan2(right.y(), right.x());
  plant_trees(b, m, g, kerb);
  for (double s = r.uniform(4.0, 20.0); s < kerb.length; s += r.uniform(22.0, 34.0)) {
    add_lamp_post(b, m, on_pavement(g, kerb.a + s * kerb.along - 0.5 * right), to_street);
  }
  for (double s = r.uniform(3.0, 25.0); s < kerb.length; s += r.uniform(12.0, 45.0)) {
    const Eigen::Vector3d foot = on_pavement(g, kerb.a + s * kerb.along - 0.45 * right);
    if (r.chance(b->settings.marks)) add_sign(b, m, foot, kerb.yaw() + (r.chance(0.5) ? M_PI : 0.0));
  }
  for (double s = r.uniform(3.0, 15.0); s < kerb.length; s += r.uniform(8.0, 30.0)) {
    const double aside = r.uniform(0.5, g.pavement - 0.4);
    add_street_furniture(b, m, on_pavement(g, kerb.a + s * kerb.along - aside * right), to_street);
  }
  park_cars(b, m, g, kerb);
}

/// Trees and bushes on the fields beyond the outermost streets.
void plant_outskirts(WorldBuilder* b, const PropMaterials& m, const CityGrid& g) {
  constexpr double kReach = 55.0;
  Random& r = b->random;
  const double x0 = g.xs.front() - kReach, x1 = g.xs.back() + kReach;
  const double y0 = g.ys.front() - kReach, y1 = g.ys.back() + kReach;
  const auto on_street = [](double p, const std::vector<double>& lines) {
    for (const double line : lines) {
      if (std::abs(p - line) < 9.0) return true;
    }
    return false;
  };
  const int count = static_cast<int>(120 * b->settings.trees);
  for (int i = 0; i < count; ++i) {
    const double x = r.uniform(x0, x1), y = r.uniform(y0, y1);
    const bool inside = x > g.xs.front() && x < g.xs.back() && y > g.ys.front() && y < g.ys.back();
    if (inside || on_street(x, g.xs) || on_street(y, g.ys)) continue;
    add_tree(b, m, {x, y, g.ground(x, y)}, r.uniform(3.0, 10.0));
  }
}

}  // namespace

void add_city_furniture(WorldBuilder* b, const PropMaterials& m, const CityGrid& g) {
  plant_outskirts(b, m, g);
  for (std::size_t i = 0; i + 1 < g.xs.size(); ++i) {
    for (std::size_t j = 0; j + 1 < g.ys.size(); ++j) {
      const double x0 = g.xs[i] + g.half_x[i], x1 = g.xs[i + 1] - g.half_x[i + 1];
      const double y0 = g.ys[j] + g.half_y[j], y1 = g.ys[j + 1] - g.half_y[j + 1];
      furnish_side(b, m, g, {{x0, y0}, {1, 0}, x1 - x0});
      furnish_side(b, m, g, {{x1, y0}, {0, 1}, y1 - y0});
      furnish_side(b, m, g, {{x1, y1}, {-1, 0}, x1 - x0});
      furnish_side(b, m, g, {{x0, y1}, {0, -1}, y1 - y0});
    }
  }
}

}  // namespace fdi_lio::simulation
