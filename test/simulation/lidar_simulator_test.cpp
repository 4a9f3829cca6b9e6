#include "fdi_lio/simulation/lidar_simulator.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "fdi_lio/simulation/cloud_encoding.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {
namespace {

constexpr double kWallX = 20.0;

/// Four walls without a roof, a mover and a vehicle that drives a bend on bumpy ground between them.
struct Yard {
  explicit Yard(bool imperfect, const std::string& model_name = "hdl64e", bool mover = false) {
    scenario.imperfections.enabled = imperfect;
    scenario.lidar.model = model_name;
    scenario.lidar.columns = 600;
    WorldBuilder builder(scenario.world, 1);
    const MaterialId white = builder.mottled(0.6, 0.2, 1.0);
    const double x = kWallX;
    add_quad(&builder.mesh, {x, -x, -1}, {x, x, -1}, {x, x, 9}, {x, -x, 9}, white);
    add_quad(&builder.mesh, {-x, -x, -1}, {-x, x, -1}, {-x, x, 9}, {-x, -x, 9}, white);
    add_quad(&builder.mesh, {-x, x, -1}, {x, x, -1}, {x, x, 9}, {-x, x, 9}, white);
    add_quad(&builder.mesh, {-x, -x, -1}, {x, -x, -1}, {x, -x, 9}, {-x, -x, 9}, white);
    if (mover) builder.add_object(make_mover(white));
    world = builder.finish();
    MotionSettings motion;
    motion.start_speed_mps = 8.0;
    motion.speed_mps = 8.0;
    motion.vibration = 2.0;
    const Route route({{-12, -12}, {12, -12}, {12, 12}, {-12, 12}}, 8.0, true);
    trajectory = std::make_unique<Trajectory>(drive(
        route, [](double, double) { return 0.0; }, motion, 0.0, 10.0, 2));
    model = make_lidar_model(scenario.lidar);
    simulator = std::make_unique<LidarSimulator>(
        *world, *trajectory, model, draw_lidar_errors(scenario, model, 5), 0.0, scenario.lidar, 5);
  }

  static Eigen::Isometry3d mover_pose(double t) { return pose_at(-10.0 + 9.0 * t, 0.5, 1.5, 0.3 * t); }

  static MovingObject make_mover(MaterialId material) {
    Mesh box;
    add_box(&box, Eigen::Isometry3d::Identity(), {4.0, 2.0, 3.0}, material);
    MovingObject object;
    MovingPart part;
    part.shape = std::make_shared<const RayMesh>(std::move(box));
    object.radius_m = part.shape->radius();
    object.parts.push_back(part);
    object.T_map_object = &Yard::mover_pose;
    return object;
  }

  /// Calls `body(point in map frame, time, return)` for each valid return of a scan.
  template <typename Body>
  void for_each_point(const LidarScan& scan, const Body& body) const {
    for (int column = 0; column < scan.columns; ++column) {
      const double t = scan.start_s + scan.column_time(column);
      const Eigen::Isometry3d T_map_lidar = trajectory->pose(t) * simulator->errors().T_imu_lidar;
      for (int beam = 0; beam < scan.beams; ++beam) {
        const LidarReturn& r = scan.returns[static_cast<std::size_t>(column * scan.beams + beam)];
        if (r.valid) body(Eigen::Vector3d(T_map_lidar * r.p_lidar.cast<double>()), t, r);
      }
    }
  }

  Scenario scenario;
  std::unique_ptr<World> world;
  std::unique_ptr<Trajectory> trajectory;
  LidarModel model;
  std::unique_ptr<LidarSimulator> simulator;
};

/// Distance to the nearest of the four walls.
double wall_distance(const Eigen::Vector3d& p) {
  return std::min(std::abs(std::abs(p.x()) - kWallX), std::abs(std::abs(p.y()) - kWallX));
}

TEST(LidarSimulator, WallsAreAsThinAsTheRangeNoise) {
  const Yard yard(false);
  double sum = 0.0;
  int count = 0;
  for (const int scan : {3, 17, 42}) {
    yard.for_each_point(yard.simulator->simulate(scan),
                        [&](const Eigen::Vector3d& p, double, const LidarReturn&) {
                          sum += std::pow(wall_distance(p), 2);
                          ++count;
                        });
  }
  const double thickness = std::sqrt(sum / count);
  std::printf("wall thickness %.4f m rms from %d points, range noise %.3f m\n", thickness, count,
              yard.model.range_noise_m);
  EXPECT_GT(count, 20000);
  EXPECT_LE(thickness, 1.2 * yard.model.range_noise_m);
  EXPECT_GT(thickness, 0.5 * yard.model.range_noise_m);
}

TEST(LidarSimulator, ImperfectionsMakeWallsThicker) {
  const Yard yard(true);
  double sum = 0.0;
  int count = 0;
  yard.for_each_point(yard.simulator->simulate(17),
                      [&](const Eigen::Vector3d& p, double, const LidarReturn&) {
                        sum += std::pow(wall_distance(p), 2);
                        ++count;
                      });
  const double thickness = std::sqrt(sum / count);
  std::printf("wall thickness with imperfections %.4f m rms\n", thickness);
  EXPECT_GT(thickness, yard.model.range_noise_m);
  EXPECT_LT(thickness, 4.0 * yard.model.range_noise_m);
}

TEST(LidarSimulator, LabelsAgreeWithGeometry) {
  const Yard yard(false, "hdl64e", true);
  int moving = 0, wrong = 0;
  for (const int scan : {0, 5, 11}) {
    yard.for_each_point(
        yard.simulator->simulate(scan), [&](const Eigen::Vector3d& p, double t, const LidarReturn& r) {
          const Eigen::Vector3d q =
              (Yard::mover_pose(t).inverse() * p).cwiseAbs() - Eigen::Vector3d(2.0, 1.0, 1.5);
          const double to_box = std::abs(q.maxCoeff());  // distance to its surface for points near it
          const bool on_object = to_box < 0.15 && q.maxCoeff() < 0.15;
          moving += r.label != 0 ? 1 : 0;
          wrong += on_object != (r.label == 1) ? 1 : 0;
        });
  }
  std::printf("%d points on the moving box, %d wrong labels\n", moving, wrong);
  EXPECT_GT(moving, 500);
  EXPECT_EQ(wrong, 0);
}

TEST(LidarSimulator, TurnsClockwiseSeenFromAbove) {
  const Yard yard(false);
  const LidarScan scan = yard.simulator->simulate(0);
  double previous = M_PI;
  for (int column = 0; column < scan.columns; ++column) {
    for (int beam = 0; beam < scan.beams; ++beam) {
      const LidarReturn& r = scan.returns[static_cast<std::size_t>(column * scan.beams + beam)];
      if (!r.valid) continue;
      const double azimuth = std::atan2(r.p_lidar.y(), r.p_lidar.x());
      if (column > 0) {
        EXPECT_LE(azimuth, previous + 1e-5) << column;
      }
      previous = azimuth;
      break;
    }
  }
  EXPECT_LT(previous, -0.98 * M_PI);
}

bool same_bytes(const LidarScan& a, const LidarScan& b) {
  const EncodedCloud x = encode_cloud(a, CloudLayout::kOuster, false),
                     y = encode_cloud(b, CloudLayout::kOuster, false);
  return x.data == y.data && x.labels == y.labels;
}

TEST(LidarSimulator, SameSeedGivesSameBytesWithAnyNumberOfThreads) {
  LidarScan single;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    single = Yard(true, "os1_64", true).simulator->simulate(9);
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
  EXPECT_TRUE(same_bytes(single, Yard(true, "os1_64", true).simulator->simulate(9)));
  EXPECT_FALSE(same_bytes(single, Yard(true, "os1_64", true).simulator->simulate(10)));
}

TEST(LidarSimulator, WholePlacesAreRepeatable) {
  Scenario scenario;
  scenario.duration_s = 5.0;
  scenario.lidar.columns = 200;
  const auto scan_of = [&](std::uint64_t seed) {
    const Place place = make_place(scenario, seed);
    const LidarModel model = make_lidar_model(scenario.lidar);
    return LidarSimulator(*place.world, *place.trajectory, model, draw_lidar_errors(scenario, model, seed),
                          0.0, scenario.lidar, seed)
        .simulate(30);
  };
  const LidarScan first = scan_of(3);
  EXPECT_TRUE(same_bytes(first, scan_of(3)));
  EXPECT_FALSE(same_bytes(first, scan_of(4)));
}

}  // namespace
}  // namespace fdi_lio::simulation
