#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "fdi_lio/simulation/city.hpp"
#include "fdi_lio/simulation/sweep.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kLaneWidth = 3.6;
constexpr double kMedian = 2.2;                                // half width of the median strip, metres
constexpr double kCarriageway = 0.8 + 3.0 * kLaneWidth + 2.6;  // verge, three lanes, hard shoulder
constexpr double kEdge = kMedian + kCarriageway;

constexpr int kOwnLane = 1;

/// Distance of a lane's middle from the axis; lane 0 is the fast one next to the median.
double lane_offset(int lane) { return kMedian + 0.8 + (lane + 0.5) * kLaneWidth; }

Route draw_axis(double length, Random* random) {
  std::vector<Eigen::Vector2d> corners{{0.0, 0.0}};
  double heading = 0.0;
  for (double way = 0.0; way < length;) {
    const double side = random->uniform(350.0, 650.0);
    corners.push_back(corners.back() + side * Eigen::Vector2d(std::cos(heading), std::sin(heading)));
    heading += random->uniform(-0.22, 0.22);
    way += side;
  }
  return Route(corners, 1800.0, false);
}

/// Steel rail with two waves on posts.
void add_guard_rail(WorldBuilder* b, const PropMaterials& m, const Route& axis, const Ground& ground,
                    double left, double facing) {
  constexpr double kPostSpacing = 4.0;
  const double f = facing;
  sweep(&b->mesh, axis, ground, stations(0.0, axis.length(), 4.0),
        {{left, 0.45}, {left + f * 0.08, 0.52}, {left, 0.6}, {left + f * 0.08, 0.68}, {left, 0.75}}, m.metal);
  for (double s = 0.0; s < axis.length(); s += kPostSpacing) {
    add_box(&b->mesh, pose_beside(axis, ground, s, left - f * 0.08, 0.33), Eigen::Vector3d(0.06, 0.1, 0.76),
            m.metal);
  }
}

void add_surfaces(WorldBuilder* b, const Route& axis, const Ground& ground) {
  Material road;
  road.texture = Texture::kHighway;
  road.reflectivity = static_cast<float>(b->random.uniform(0.18, 0.3));
  road.contrast = 0.2f;
  const std::vector<double> at = stations(0.0, axis.length(), 6.0);
  const MaterialId grass = b->mottled(0.4, 0.4, 1.5);
  const MaterialId asphalt = b->add_material(road);
  for (const double side : {1.0, -1.0}) {
    sweep(&b->mesh, axis, ground, at, {{side * kMedian, 0.0}, {side * kEdge, 0.0}}, asphalt, -0.8);
    std::vector<ProfilePoint> bank{{side * kEdge, 0.0}, {side * (kEdge + 1.5), -0.1}};
    double up = -0.1;
    const double slope = b->random.uniform(-0.1, 0.25);
    for (double left = kEdge + 5.0; left < kEdge + 80.0; left += 6.0) {
      up += 6.0 * slope * std::exp(-(left - kEdge) / 20.0) + b->random.uniform(-0.15, 0.15);
      bank.push_back({side * left, up});
    }
    sweep(&b->mesh, axis, ground, at, bank, grass);
  }
  sweep(&b->mesh, axis, ground, at, {{-kMedian, 0.02}, {kMedian, 0.02}}, grass);
}

void add_bridge(WorldBuilder* b, const PropMaterials& m, const Route& axis, const Ground& ground, double s) {
  add_box(&b->mesh, pose_beside(axis, ground, s, 0.0, 5.9), Eigen::Vector3d(9.0, 90.0, 1.1), m.concrete);
  for (const double left : {-kEdge - 2.5, 0.0, kEdge + 2.5}) {
    add_box(&b->mesh, pose_beside(axis, ground, s, left, 2.4), Eigen::Vector3d(7.0, 0.9, 6.4), m.concrete);
  }
}

void add_gantry(WorldBuilder* b, const PropMaterials& m, const Route& axis, const Ground& ground, double s) {
  for (const double left : {-kEdge - 0.8, -0.4}) {
    add_tube(&b->mesh, beside(axis, ground, s, left, 0.0), beside(axis, ground, s, left, 7.0), 0.2, 0.2, 10,
             m.metal);
  }
  add_box(&b->mesh, pose_beside(axis, ground, s, -0.5 * kEdge, 7.0), Eigen::Vector3d(0.4, kEdge, 0.4),
          m.metal);
  for (const double left : {-5.5, -11.5}) {
    add_box(&b->mesh, pose_beside(axis, ground, s - 0.3, left, 6.6), Eigen::Vector3d(0.06, 4.2, 2.6),
            m.sign_front);
  }
}

void add_roadside(WorldBuilder* b, const PropMaterials& m, const Route& axis, const Ground& ground) {
  Random& r = b->random;
  const double length = axis.length();
  for (const double left : {-1.2, 1.2}) add_guard_rail(b, m, axis, ground, left, left > 0.0 ? 1.0 : -1.0);
  for (const double left : {-kEdge - 0.5, kEdge + 0.5})
    add_guard_rail(b, m, axis, ground, left, left > 0.0 ? -1.0 : 1.0);
  for (double s = 10.0; s < length; s += 50.0) {
    for (const double left : {-kEdge - 1.0, kEdge + 1.0}) {
      add_tube(&b->mesh, beside(axis, ground, s, left, -0.1), beside(axis, ground, s, left, 1.05), 0.06, 0.06,
               6, m.plate, true);
    }
  }
  for (double s = r.uniform(100.0, 400.0); s < length; s += r.uniform(500.0, 900.0)) {
    if (r.chance(b->settings.marks)) add_gantry(b, m, axis, ground, s);
  }
  for (double s = r.uniform(200.0, 700.0); s < length; s += r.uniform(700.0, 1500.0)) {
    if (r.chance(0.5 * std::min(1.0, b->settings.relief))) add_bridge(b, m, axis, ground, s);
  }
  for (double s = r.uniform(0.0, 60.0); s < length;
       s += r.uniform(12.0, 60.0) / std::max(0.1, b->settings.trees)) {
    const double left = (r.chance(0.5) ? 1.0 : -1.0) * (kEdge + r.uniform(10.0, 45.0));
    add_tree(b, m, beside(axis, ground, s, left, 0.0), r.uniform(5.0, 12.0));
  }
}

/// Traffic of the other carriageway.
PoseFunction oncoming(const Route& axis, const Ground& ground, double start, double speed, int lane) {
  auto shared = std::make_shared<const Route>(axis);
  return [=](double t) {
    const double s = std::max(1.0, start - speed * t);
    Eigen::Isometry3d pose = pose_beside(*shared, ground, s, lane_offset(lane), 0.0);
    pose.rotate(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
    return pose;
  };
}

/// A place in the traffic around the sensor: each lane has one speed, so that nobody runs into another.
struct Slot {
  int lane;
  double ahead;
};

std::vector<Slot> draw_slots(Random* r) {
  constexpr double kSpacing = 20.0;
  constexpr double kBehind = -80.0, kAhead = 110.0;
  std::vector<Slot> slots;
  for (int lane = 0; lane < 3; ++lane) {
    for (double ahead = kBehind; ahead < kAhead; ahead += kSpacing) {
      if (lane == kOwnLane && std::abs(ahead) < kSpacing) continue;
      slots.push_back({lane, ahead + r->uniform(-4.0, 4.0)});
    }
  }
  for (std::size_t i = slots.size(); i > 1; --i)
    std::swap(slots[i - 1], slots[static_cast<std::size_t>(r->index(static_cast<int>(i)))]);
  return slots;
}

/// Two thirds of the cars drive along with the sensor, at nearly its speed, so that they stay in view for
/// long.
void add_traffic(WorldBuilder* b, const PropMaterials& m, const Scenario& scenario, const Route& axis,
                 const Ground& ground, double start, const Trajectory& own) {
  Random& r = b->random;
  const double factors[3] = {r.uniform(1.01, 1.06), 1.0, r.uniform(0.93, 0.99)};
  std::vector<Slot> slots = draw_slots(&r);
  for (int i = 0; i < b->settings.cars; ++i) {
    const CarKind kind = r.chance(0.25) ? CarKind::kTruck : draw_car_kind(&r);
    PoseFunction pose;
    if (i % 3 == 2 || slots.empty()) {
      pose = oncoming(axis, ground, r.uniform(0.2, 1.9) * axis.length(), 30.0 - 2.5 * (i % 3), r.index(3));
    } else {
      const Slot slot = slots.back();
      slots.pop_back();
      MotionSettings motion = scenario.motion;
      motion.speed_mps *= factors[slot.lane];
      const Route lane(parallel_points(axis, 0.0, axis.length(), -lane_offset(slot.lane), 60.0), 1500.0,
                       false);
      pose = convoy_drive(lane, motion, ground, scenario.duration_s, start + slot.ahead);
    }
    if (!comes_near(pose, own, 3.2)) b->add_object(make_moving_car(b, m, kind, pose));
  }
}

}  // namespace

Place make_highway(const Scenario& scenario, std::uint64_t seed) {
  constexpr double kStart = 120.0;
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const Ground ground = make_rolling_ground(scenario.world.rolling_m, &b.random);
  const Route axis = draw_axis(kStart + scenario.motion.speed_mps * scenario.duration_s + 250.0, &b.random);
  add_surfaces(&b, axis, ground);
  add_roadside(&b, materials, axis, ground);
  const Route way(parallel_points(axis, 0.0, axis.length(), -lane_offset(kOwnLane), 60.0), 1500.0, false);
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(way, ground, scenario.motion, kStart, scenario.duration_s, seed));
  add_traffic(&b, materials, scenario, axis, ground, kStart, *place.trajectory);
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
