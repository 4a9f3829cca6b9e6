#include <algorithm>
#include <cmath>

#include "fdi_lio/simulation/city.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/surface_nets.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

/// A drift (mine gallery) between two points of the plan.
struct Drift {
  Eigen::Vector2d a, b;
  double half_width;
};

double distance_to(const Drift& drift, const Eigen::Vector2d& p) {
  const Eigen::Vector2d along = drift.b - drift.a;
  const double u = std::clamp((p - drift.a).dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (p - drift.a - u * along).norm();
}

/// Smooth noise in space, about -1 to 1, made of three planes of noise.
double noise3(const Eigen::Vector3d& p, double scale, std::uint32_t seed) {
  const Eigen::Vector3f q = (p / scale).cast<float>();
  const float sum = smooth_noise(q.x() + 0.31f * q.z(), q.y(), seed) +
                    smooth_noise(q.y() + 0.27f * q.x(), q.z(), seed + 1) +
                    smooth_noise(q.z() + 0.23f * q.y(), q.x(), seed + 2);
  return 2.0 * (sum / 1.5 - 1.0);
}

/// A loop of drifts with bends, and dead ends and cross-cuts off it.
struct Plan {
  std::vector<Eigen::Vector2d> loop;
  std::vector<Drift> drifts;
};

Plan draw_plan(const WorldSettings& settings, Random* r) {
  Plan plan;
  const double half = 0.5 * settings.width_m;
  const double a = settings.length_m * r->uniform(0.45, 0.55), c = settings.length_m * r->uniform(0.25, 0.35);
  constexpr int kCorners = 9;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2.0 * M_PI * i / kCorners;
    const double share = r->uniform(0.8, 1.15);
    plan.loop.emplace_back(share * a * std::cos(angle), share * c * std::sin(angle));
  }
  for (int i = 0; i < kCorners; ++i) {
    const Eigen::Vector2d from = plan.loop[static_cast<std::size_t>(i)];
    const Eigen::Vector2d to = plan.loop[static_cast<std::size_t>((i + 1) % kCorners)];
    plan.drifts.push_back({from, to, half * r->uniform(0.9, 1.1)});
    const Eigen::Vector2d start = from + r->uniform(0.2, 0.8) * (to - from);
    const Eigen::Vector2d outward = Eigen::Rotation2Dd(r->uniform(-0.5, 0.5)) * start.normalized();
    if (r->chance(0.6))
      plan.drifts.push_back({start, start + r->uniform(10.0, 30.0) * outward, half * r->uniform(0.7, 1.0)});
  }
  plan.drifts.push_back({plan.loop[2], plan.loop[7], 0.85 * half});  // cross-cut
  return plan;
}

SignedDistance rock_of(const Plan& plan, const WorldSettings& settings, const Ground& ground,
                       std::uint32_t seed) {
  const double height = settings.height_m, rough = 0.3 * settings.relief;
  return [=](const Eigen::Vector3d& p) {
    const Eigen::Vector2d flat = p.head<2>();
    double aside = 1e9;
    for (const Drift& drift : plan.drifts) {
      // Rounded union: where drifts meet the rock between them is broken off.
      const double d = distance_to(drift, flat) - drift.half_width;
      const double h = std::clamp(0.5 + 0.5 * (aside - d) / 1.0, 0.0, 1.0);
      aside = (1.0 - h) * aside + h * d - 0.5 * h * (1.0 - h);
    }
    const double up = p.z() - ground(p.x(), p.y());
    // Walls lean together towards an arched back.
    const double arch =
        aside + 1.2 * std::pow(std::max(0.0, up - 0.45 * height) / (0.55 * height), 2.0) * 1.3;
    const double roof = up - height;
    const double walls =
        std::max(arch, roof) +
        rough * (noise3(p, 1.7, seed) + 0.5 * noise3(p, 0.6, seed + 7) + 0.8 * noise3(p, 6.0, seed + 13));
    const double floor = -up + 0.05 * settings.relief * noise3(p, 0.9, seed + 23);
    return std::max(walls, floor) * 0.7;
  };
}

/// Pipes, a cable, reflector studs and some muck piles.
void add_fittings(WorldBuilder* b, const PropMaterials& m, const Plan& plan, const Ground& ground,
                  double half, double height) {
  Random& r = b->random;
  for (std::size_t i = 0; i < plan.loop.size(); ++i) {
    const Eigen::Vector2d a = plan.loop[i], c = plan.loop[(i + 1) % plan.loop.size()];
    const Eigen::Vector2d along = (c - a).normalized(), left(-along.y(), along.x());
    const double length = (c - a).norm();
    for (double s = r.uniform(2.0, 10.0); s < length; s += r.uniform(8.0, 20.0)) {
      const Eigen::Vector2d p = a + s * along + (r.chance(0.5) ? 1.0 : -1.0) * (half - 0.15) * left;
      const double z = ground(p.x(), p.y());
      if (r.chance(0.4 * b->settings.marks)) {
        add_box(&b->mesh, pose_at(p.x(), p.y(), z + 1.7, std::atan2(along.y(), along.x())),
                Eigen::Vector3d(0.3, 0.3, 0.4), m.sign_front);
      }
      if (r.chance(0.25))
        add_ellipsoid(&b->mesh, {p.x(), p.y(), z},
                      {r.uniform(0.4, 0.9), r.uniform(0.4, 0.9), r.uniform(0.3, 0.7)}, 7, m.concrete);
    }
    const Eigen::Vector2d p = a + 3.0 * along + 0.5 * half * left, q = c - 3.0 * along + 0.5 * half * left;
    add_tube(&b->mesh, {p.x(), p.y(), ground(p.x(), p.y()) + height - 1.1},
             {q.x(), q.y(), ground(q.x(), q.y()) + height - 1.1}, 0.3, 0.3, 10,
             m.leaves);  // ventilation duct of cloth
  }
}

}  // namespace

Place make_mine(const Scenario& scenario, std::uint64_t seed) {
  constexpr double kCell = 0.3;
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const Ground ground = make_rolling_ground(scenario.world.rolling_m, &b.random);
  const Plan plan = draw_plan(scenario.world, &b.random);
  Material rock;
  rock.texture = Texture::kRock;
  rock.reflectivity = static_cast<float>(b.random.uniform(0.15, 0.4));
  rock.contrast = 0.5f;
  Eigen::AlignedBox3d bounds;
  for (const Drift& drift : plan.drifts) {
    for (const Eigen::Vector2d& p : {drift.a, drift.b}) {
      const double z = ground(p.x(), p.y()), margin = scenario.world.width_m;
      bounds.extend(Eigen::Vector3d(p.x() - margin, p.y() - margin, z - 2.5));
      bounds.extend(Eigen::Vector3d(p.x() + margin, p.y() + margin, z + scenario.world.height_m + 2.5));
    }
  }
  const auto noise_seed = static_cast<std::uint32_t>(b.random.next());
  add_surface(&b.mesh, rock_of(plan, scenario.world, ground, noise_seed), bounds, kCell,
              b.add_material(rock));
  add_fittings(&b, materials, plan, ground, 0.5 * scenario.world.width_m, scenario.world.height_m);
  const Route way(plan.loop, 5.0, true);
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(way, ground, scenario.motion, 4.0, scenario.duration_s, seed));
  const WalkerShapes shapes(&b, materials);
  for (int i = 0; i < scenario.world.walkers; ++i) {
    const Route::Point p = way.at(b.random.uniform(0.0, way.length()));
    const double yaw = p.heading, aside = 0.35 * scenario.world.width_m * (b.random.chance(0.5) ? 1.0 : -1.0);
    const Eigen::Vector3d from(p.position.x() - aside * std::sin(yaw), p.position.y() + aside * std::cos(yaw),
                               ground(p.position.x(), p.position.y()));
    const PoseFunction pose = walk_between(
        from, from + 5.0 * Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0), 1.0, b.random.uniform());
    if (!comes_near(pose, *place.trajectory, 1.3)) b.add_object(shapes.make(1.0, &b.random, pose));
  }
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
