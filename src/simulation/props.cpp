#include "fdi_lio/simulation/props.hpp"

#include <cmath>

namespace fdi_lio::simulation {

namespace {

MaterialId plain(WorldBuilder* builder, double reflectivity, double mirror = 0.0, double retro = 0.0) {
  Material material;
  material.reflectivity = static_cast<float>(reflectivity);
  material.mirror_share = static_cast<float>(mirror);
  material.retro_gain = static_cast<float>(retro);
  return builder->add_material(material);
}

Eigen::Vector3d random_unit(Random* random) {
  const double z = random->uniform(-1.0, 1.0);
  const double angle = random->uniform(0.0, 2.0 * M_PI);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

/// Leaves are small squares that hang anyhow, in clumps near the rim of the crown.
void add_crown(WorldBuilder* b, MaterialId material, const Eigen::Vector3d& centre,
               const Eigen::Vector3d& radii) {
  constexpr double kLeafSize = 0.22;
  const int clumps = 14 + b->random.index(8);
  const int leaves = 22;
  for (int i = 0; i < clumps; ++i) {
    const double depth = std::cbrt(b->random.uniform(0.15, 1.0));
    const Eigen::Vector3d middle = centre + depth * radii.cwiseProduct(random_unit(&b->random));
    for (int k = 0; k < leaves; ++k) {
      const Eigen::Vector3d at =
          middle + 0.28 * radii.minCoeff() * b->random.normal() * random_unit(&b->random);
      const Eigen::Vector3d u = kLeafSize * b->random.uniform(0.6, 1.4) * random_unit(&b->random);
      const Eigen::Vector3d v = kLeafSize * random_unit(&b->random).cross(u.normalized());
      add_quad(&b->mesh, at, at + u, at + u + v, at + v, material);
    }
  }
}

}  // namespace

// Reflectivities near 905 nm: leaves are bright in the near infrared, rubber and glass dark, signs
// retro-reflect.
PropMaterials::PropMaterials(WorldBuilder* b)
    : bark(b->mottled(0.25, 0.4, 0.3)),
      leaves(b->mottled(0.5, 0.3, 0.7)),
      metal(plain(b, 0.35, 0.1)),
      concrete(b->mottled(0.32, 0.15, 1.0)),
      sign_front(plain(b, 0.8, 0.0, 8.0)),
      sign_back(plain(b, 0.3)),
      rubber(plain(b, 0.05)),
      window(plain(b, 0.06, 0.7)),
      plate(plain(b, 0.8, 0.0, 5.0)),
      lamp(plain(b, 0.6, 0.2, 2.0)),
      clothes_dark(b->mottled(0.15, 0.3, 0.3)),
      clothes_light(b->mottled(0.55, 0.3, 0.3)),
      skin(plain(b, 0.5)) {}

void add_tree(WorldBuilder* b, const PropMaterials& m, const Eigen::Vector3d& foot, double height) {
  Random& r = b->random;
  const double trunk = height * r.uniform(0.3, 0.45);
  const double girth = 0.012 * height + r.uniform(0.05, 0.12);
  const Eigen::Vector3d lean(r.uniform(-0.03, 0.03), r.uniform(-0.03, 0.03), 0.0);
  const Eigen::Vector3d fork = foot + Eigen::Vector3d(0, 0, trunk) + trunk * lean;
  const Eigen::Vector3d root(0.0, 0.0, 0.4);
  add_tube(&b->mesh, foot - root, fork, girth * 1.2, girth * 0.85, 8, m.bark);
  const Eigen::Vector3d centre = foot + Eigen::Vector3d(0, 0, 0.5 * (height + trunk)) + height * lean;
  const double spread = height * r.uniform(0.2, 0.3);
  const Eigen::Vector3d radii(spread, spread, 0.5 * (height - trunk));
  const int branches = 3 + r.index(3);
  for (int i = 0; i < branches; ++i) {
    const Eigen::Vector3d tip = centre + 0.75 * radii.cwiseProduct(random_unit(&r));
    add_tube(&b->mesh, fork, tip, 0.5 * girth, 0.2 * girth, 5, m.bark);
  }
  add_crown(b, m.leaves, centre, radii);
}

void add_sign(WorldBuilder* b, const PropMaterials& m, const Eigen::Vector3d& foot, double yaw) {
  const double height = b->random.uniform(2.2, 2.8);
  add_tube(&b->mesh, foot, foot + Eigen::Vector3d(0, 0, height), 0.03, 0.03, 8, m.metal);
  const double size = b->random.uniform(0.5, 0.75);
  Eigen::Isometry3d T = pose_at(foot.x(), foot.y(), foot.z() + height - 0.5 * size, yaw);
  T.translate(Eigen::Vector3d(0.05, 0.0, 0.0));
  add_box(&b->mesh, T, Eigen::Vector3d(0.02, size, size), m.sign_back);
  T.translate(Eigen::Vector3d(0.015, 0.0, 0.0));
  add_box(&b->mesh, T, Eigen::Vector3d(0.005, 0.96 * size, 0.96 * size), m.sign_front);
}

void add_lamp_post(WorldBuilder* b, const PropMaterials& m, const Eigen::Vector3d& foot, double yaw) {
  const double height = b->random.uniform(6.0, 9.0);
  const Eigen::Vector3d top = foot + Eigen::Vector3d(0, 0, height);
  const Eigen::Vector3d arm(std::cos(yaw), std::sin(yaw), 0.15);
  add_tube(&b->mesh, foot, foot + Eigen::Vector3d(0, 0, 1.2), 0.11, 0.11, 10, m.metal);
  add_tube(&b->mesh, foot + Eigen::Vector3d(0, 0, 1.2), top, 0.08, 0.05, 10, m.metal);
  add_tube(&b->mesh, top, top + 1.5 * arm, 0.04, 0.04, 6, m.metal);
  const Eigen::Vector3d head = top + 1.7 * arm;
  add_box(&b->mesh, pose_at(head.x(), head.y(), head.z(), yaw), Eigen::Vector3d(0.7, 0.25, 0.12), m.metal);
}

void add_street_furniture(WorldBuilder* b, const PropMaterials& m, const Eigen::Vector3d& foot, double yaw) {
  const auto box = [&](double x, double y, double z, const Eigen::Vector3d& size, MaterialId material) {
    Eigen::Isometry3d T = pose_at(foot.x(), foot.y(), foot.z(), yaw);
    T.translate(Eigen::Vector3d(x, y, z));
    add_box(&b->mesh, T, size, material);
  };
  switch (b->random.index(5)) {
    case 0:  // litter bin
      add_tube(&b->mesh, foot, foot + Eigen::Vector3d(0, 0, 0.9), 0.22, 0.25, 10, m.metal, true);
      return;
    case 1:  // bollard
      add_tube(&b->mesh, foot, foot + Eigen::Vector3d(0, 0, 0.85), 0.07, 0.06, 8, m.concrete, true);
      return;
    case 2:  // switch box
      box(0, 0, 0.55, {0.4, 0.9, 1.1}, m.concrete);
      return;
    case 3:  // planter with a shrub
      box(0, 0, 0.25, {0.8, 1.2, 0.5}, m.concrete);
      add_crown(b, m.leaves, foot + Eigen::Vector3d(0, 0, 0.9), Eigen::Vector3d(0.5, 0.6, 0.4));
      return;
    default:  // bench
      box(0, 0, 0.45, {0.45, 1.6, 0.06}, m.bark);
      box(-0.22, 0, 0.75, {0.05, 1.6, 0.4}, m.bark);
      box(0, -0.6, 0.22, {0.4, 0.08, 0.44}, m.concrete);
      box(0, 0.6, 0.22, {0.4, 0.08, 0.44}, m.concrete);
  }
}

}  // namespace fdi_lio::simulation
