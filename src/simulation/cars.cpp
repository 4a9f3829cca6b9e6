#include <cmath>
#include <utility>

#include "fdi_lio/simulation/props.hpp"

namespace fdi_lio::simulation {

namespace {

/// Side view of a car, metres: body from `floor` to `belt`, cabin from `belt` to `roof` between four x
/// positions.
struct CarShape {
  double length, width, floor, belt, roof;
  double screen_foot, screen_top, rear_top, rear_foot;  ///< x of the cabin's corners, front to back
  double wheel_radius, front_axle, rear_axle;
};

CarShape shape_of(CarKind kind) {
  switch (kind) {
    case CarKind::kEstate:
      return {4.7, 1.82, 0.25, 0.95, 1.48, 0.95, 0.25, -1.9, -2.25, 0.32, 1.4, -1.35};
    case CarKind::kVan:
      return {5.4, 2.0, 0.35, 1.15, 2.4, 2.2, 1.5, -2.6, -2.68, 0.34, 1.75, -1.6};
    case CarKind::kTruck:
      return {9.5, 2.5, 0.75, 1.0, 3.6, 2.55, 2.5, -4.7, -4.75, 0.5, 3.4, -2.9};
    case CarKind::kCompact:
      break;
  }
  return {4.1, 1.75, 0.22, 0.92, 1.46, 0.95, 0.25, -1.25, -1.85, 0.31, 1.25, -1.25};
}

MaterialId draw_paint(WorldBuilder* b) {
  Material paint;
  paint.reflectivity = static_cast<float>(b->random.chance(0.4) ? b->random.uniform(0.04, 0.15)
                                                                : b->random.uniform(0.3, 0.75));
  paint.mirror_share = 0.25f;  // a clear coat throws much of the light away from the sensor
  return b->add_material(paint);
}

void add_wheels(Mesh* mesh, const CarShape& s, const PropMaterials& m) {
  for (const double x : {s.front_axle, s.rear_axle}) {
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector3d inner(x, side * (0.5 * s.width - 0.24), s.wheel_radius);
      const Eigen::Vector3d outer(x, side * (0.5 * s.width - 0.01), s.wheel_radius);
      add_tube(mesh, inner, outer, s.wheel_radius, s.wheel_radius, 12, m.rubber, true);
    }
  }
}

/// Windows all round and the roof; the sides lean inwards.
void add_cabin(Mesh* mesh, const CarShape& s, MaterialId paint, MaterialId window) {
  const double foot = 0.5 * s.width - 0.03;
  const double top = 0.5 * s.width - (s.roof > 2.0 ? 0.12 : 0.22);
  const auto corner = [&](double x, double y, double z) { return Eigen::Vector3d(x, y, z); };
  add_quad(mesh, corner(s.screen_foot, -foot, s.belt), corner(s.screen_foot, foot, s.belt),
           corner(s.screen_top, top, s.roof), corner(s.screen_top, -top, s.roof), window);
  add_quad(mesh, corner(s.rear_foot, foot, s.belt), corner(s.rear_foot, -foot, s.belt),
           corner(s.rear_top, -top, s.roof), corner(s.rear_top, top, s.roof), s.roof > 2.0 ? paint : window);
  for (const double side : {-1.0, 1.0}) {
    add_quad(mesh, corner(s.rear_foot, side * foot, s.belt), corner(s.screen_foot, side * foot, s.belt),
             corner(s.screen_top, side * top, s.roof), corner(s.rear_top, side * top, s.roof),
             s.roof > 2.0 ? paint : window);
    // Pillars stand a little proud of the glass.
    const double middle = 0.5 * (s.screen_top + s.rear_top);
    const double proud = side * 0.01;
    add_quad(mesh, corner(middle - 0.06, side * foot + proud, s.belt),
             corner(middle + 0.06, side * foot + proud, s.belt),
             corner(middle + 0.06, side * top + proud, s.roof),
             corner(middle - 0.06, side * top + proud, s.roof), paint);
  }
  add_quad(mesh, corner(s.rear_top, -top, s.roof), corner(s.screen_top, -top, s.roof),
           corner(s.screen_top, top, s.roof), corner(s.rear_top, top, s.roof), paint);
}

}  // namespace

CarKind draw_car_kind(Random* random) {
  const double draw = random->uniform();
  if (draw < 0.5) return CarKind::kCompact;
  if (draw < 0.8) return CarKind::kEstate;
  return draw < 0.95 ? CarKind::kVan : CarKind::kTruck;
}

Mesh make_car(WorldBuilder* b, const PropMaterials& m, CarKind kind) {
  const CarShape s = shape_of(kind);
  const MaterialId paint = draw_paint(b);
  Mesh mesh;
  add_box(&mesh, pose_at(0.0, 0.0, 0.5 * (s.floor + s.belt)),
          Eigen::Vector3d(s.length, s.width, s.belt - s.floor), paint);
  add_cabin(&mesh, s, paint, m.window);
  add_wheels(&mesh, s, m);
  const double nose = 0.5 * s.length;
  for (const double side : {-1.0, 1.0}) {
    const double y = side * (0.5 * s.width - 0.25);
    add_box(&mesh, pose_at(nose, y, s.belt - 0.25), Eigen::Vector3d(0.04, 0.35, 0.14), m.lamp);
    add_box(&mesh, pose_at(-nose, y, s.belt - 0.2), Eigen::Vector3d(0.04, 0.25, 0.16), m.lamp);
    add_box(&mesh, pose_at(s.screen_foot - 0.35, side * (0.5 * s.width + 0.08), s.belt + 0.08),
            Eigen::Vector3d(0.1, 0.16, 0.14), paint);
  }
  add_box(&mesh, pose_at(-nose, 0.0, s.floor + 0.3), Eigen::Vector3d(0.03, 0.52, 0.11), m.plate);
  add_box(&mesh, pose_at(nose, 0.0, s.floor + 0.2), Eigen::Vector3d(0.03, 0.52, 0.11), m.plate);
  return mesh;
}

MovingObject make_moving_car(WorldBuilder* b, const PropMaterials& m, CarKind kind,
                             std::function<Eigen::Isometry3d(double)> T_map_object) {
  MovingObject car;
  auto shape = std::make_shared<const RayMesh>(make_car(b, m, kind));
  car.radius_m = shape->radius();
  MovingPart body;
  body.shape = shape;
  car.parts.push_back(body);
  car.T_map_object = std::move(T_map_object);
  return car;
}

}  // namespace fdi_lio::simulation
