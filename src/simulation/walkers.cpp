#include <cmath>
#include <utility>

#include "fdi_lio/simulation/props.hpp"

namespace fdi_lio::simulation {

WalkerShapes::WalkerShapes(WorldBuilder* b, const PropMaterials& m) {
  for (int i = 0; i < 4; ++i) {
    const MaterialId clothes = i % 2 == 0 ? m.clothes_dark : m.clothes_light;
    const double stout = b->random.uniform(0.9, 1.25);
    Mesh body;
    add_ellipsoid(&body, {0.0, 0.0, 1.15}, {0.14 * stout, 0.22 * stout, 0.36}, 12, clothes);
    add_ellipsoid(&body, {0.0, 0.0, 0.92}, {0.14 * stout, 0.19 * stout, 0.2}, 10, m.clothes_dark);
    add_ellipsoid(&body, {0.02, 0.0, 1.63}, {0.1, 0.085, 0.13}, 10, m.skin);
    if (i == 3) add_ellipsoid(&body, {-0.2, 0.0, 1.25}, {0.14, 0.16, 0.26}, 8, m.clothes_dark);  // rucksack
    bodies_.push_back(std::make_shared<const RayMesh>(std::move(body)));
  }
  Mesh leg;
  add_tube(&leg, {0.0, 0.0, 0.0}, {0.02, 0.0, -0.45}, 0.085, 0.06, 8, m.clothes_dark);
  add_tube(&leg, {0.02, 0.0, -0.45}, {0.0, 0.0, -0.86}, 0.06, 0.045, 8, m.clothes_dark);
  add_ellipsoid(&leg, {0.07, 0.0, -0.87}, {0.14, 0.05, 0.045}, 8, m.rubber);
  leg_ = std::make_shared<const RayMesh>(std::move(leg));
  Mesh arm;
  add_tube(&arm, {0.0, 0.0, 0.0}, {0.05, 0.0, -0.58}, 0.05, 0.035, 8, m.clothes_light, true);
  arm_ = std::make_shared<const RayMesh>(std::move(arm));
}

MovingObject WalkerShapes::make(double speed, Random* random,
                                std::function<Eigen::Isometry3d(double)> T_map_object) const {
  MovingObject walker;
  walker.radius_m = 1.1;
  walker.centre = Eigen::Vector3d(0.0, 0.0, 0.9);
  walker.T_map_object = std::move(T_map_object);
  const double step_hz = speed > 0.05 ? 0.55 + 0.3 * speed : 0.0;  // cycles of two steps a second
  const double swing = speed > 0.05 ? 0.2 + 0.2 * speed : 0.0;
  const double phase = random->uniform(0.0, 2.0 * M_PI);
  const auto part = [&](const std::shared_ptr<const RayMesh>& shape, double y, double z, double amplitude,
                        double shift) {
    walker.parts.push_back({shape, Eigen::Vector3d(0.0, y, z), amplitude, step_hz, phase + shift});
  };
  part(bodies_[static_cast<std::size_t>(random->index(static_cast<int>(bodies_.size())))], 0.0, 0.0, 0.0,
       0.0);
  part(leg_, 0.1, 0.92, swing, 0.0);
  part(leg_, -0.1, 0.92, swing, M_PI);
  part(arm_, 0.27, 1.42, 0.8 * swing, M_PI);
  part(arm_, -0.27, 1.42, 0.8 * swing, 0.0);
  return walker;
}

std::function<Eigen::Isometry3d(double)> walk_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                                      double speed, double start_phase) {
  const double length = (b - a).norm();
  const double heading = std::atan2(b.y() - a.y(), b.x() - a.x());
  constexpr double kTurnTime = 1.5;  // seconds to turn round at an end
  const double leg_time = length / speed + kTurnTime;
  return [=](double t) {
    const double phase = t / (2.0 * leg_time) + start_phase;
    const double in_cycle = (phase - std::floor(phase)) * 2.0 * leg_time;
    const bool back = in_cycle >= leg_time;
    const double in_leg = back ? in_cycle - leg_time : in_cycle;
    const double way = std::min(in_leg * speed, length);
    const double turn = std::max(0.0, in_leg - length / speed) / kTurnTime * M_PI;
    const Eigen::Vector3d p =
        back ? Eigen::Vector3d(b + (a - b) * (way / length)) : Eigen::Vector3d(a + (b - a) * (way / length));
    return pose_at(p.x(), p.y(), p.z(), heading + (back ? M_PI : 0.0) + turn);
  };
}

}  // namespace fdi_lio::simulation
