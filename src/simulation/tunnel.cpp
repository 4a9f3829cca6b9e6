#include <cmath>

#include "fdi_lio/simulation/city.hpp"
#include "fdi_lio/simulation/sweep.hpp"
#include "fdi_lio/simulation/traffic.hpp"
#include "fdi_lio/simulation/tube.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kOpen = 70.0;  // metres of open country before each portal
constexpr double kLane = 1.8;   // metres from the centre line

/// Straight, bend, straight, with open country at both ends.
Route draw_axis(const WorldSettings& settings, Random* random) {
  const double bend = (random->chance(0.5) ? 1.0 : -1.0) * random->uniform(20.0, 50.0) * M_PI / 180.0;
  const double first = kOpen + settings.length_m + 40.0;
  const double second = settings.length_m * random->uniform(0.8, 1.1) + 40.0 + kOpen;
  const Eigen::Vector2d corner(first, 0.0);
  const Eigen::Vector2d end = corner + second * Eigen::Vector2d(std::cos(bend), std::sin(bend));
  return Route({{0.0, 0.0}, corner, end}, random->uniform(90.0, 150.0), false);
}

/// Bulb for turning round beyond arc length `s`; `direction` +1 at the end, -1 at the begin of the axis.
void add_turn(const Route& axis, double s, double direction, std::vector<Eigen::Vector2d>* corners) {
  const Route::Point point = axis.at(s);
  const Eigen::Rotation2Dd R(point.heading + (direction > 0.0 ? 0.0 : M_PI));
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(14.0, -kLane), Eigen::Vector2d(24.0, -10.0), Eigen::Vector2d(42.0, -10.0),
        Eigen::Vector2d(42.0, 10.0), Eigen::Vector2d(24.0, 10.0), Eigen::Vector2d(14.0, kLane)}) {
    corners->push_back(point.position + R * corner);
  }
}

/// Out in the right-hand lane, round a bulb, back, round a bulb.
Route out_and_back(const Route& axis) {
  constexpr double kStep = 12.0;
  constexpr double kBulb = 50.0;  // metres of the axis that a bulb needs
  const double begin = kBulb, end = axis.length() - kBulb;
  std::vector<Eigen::Vector2d> corners = parallel_points(axis, begin, end, -kLane, kStep);
  add_turn(axis, end, 1.0, &corners);
  for (const Eigen::Vector2d& p : parallel_points(axis, end, begin, kLane, kStep)) corners.push_back(p);
  add_turn(axis, begin, -1.0, &corners);
  return Route(corners, 9.0, true);
}

}  // namespace

Place make_tunnel(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const Ground ground = make_rolling_ground(scenario.world.rolling_m, &b.random);
  const Route axis = draw_axis(scenario.world, &b.random);
  add_country_road(&b, materials, axis, ground, 0.0, kOpen);
  add_road_tunnel(&b, materials, axis, ground, kOpen, axis.length() - kOpen);
  add_country_road(&b, materials, axis, ground, axis.length() - kOpen, axis.length());
  const Route way = out_and_back(axis);
  Place place;
  place.trajectory =
      std::make_unique<Trajectory>(drive(way, ground, scenario.motion, 0.0, scenario.duration_s, seed));
  for (int i = 0; i < scenario.world.cars; ++i) {
    const double start = way.length() * b.random.uniform(0.03, 0.97);
    const PoseFunction pose = convoy_drive(way, scenario.motion, ground, scenario.duration_s, start);
    if (!comes_near(pose, *place.trajectory, 3.3)) {
      b.add_object(make_moving_car(&b, materials, draw_car_kind(&b.random), pose));
    }
  }
  place.world = b.finish();
  return place;
}

Place make_street_tunnel(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder b(scenario.world, seed);
  const PropMaterials materials(&b);
  const CityGrid grid = draw_city_grid(&b, 3, 2, 0, 1);
  add_city_ground(&b, grid);
  add_city_buildings(&b, grid);
  add_city_furniture(&b, materials, grid);
  constexpr double kOuterRoad = 60.0;  // the city's streets go on this far
  const double city_end = grid.xs.back() + kOuterRoad;
  const double length = scenario.world.length_m;
  const double bend = (b.random.chance(0.5) ? 1.0 : -1.0) * b.random.uniform(20.0, 40.0) * M_PI / 180.0;
  const Eigen::Vector2d corner(city_end + 20.0 + length, 0.0);
  const Eigen::Vector2d end = corner + 1.5 * length * Eigen::Vector2d(std::cos(bend), std::sin(bend));
  const Route axis({{grid.xs.front() - kOuterRoad, 0.0}, corner, end}, 110.0, false);
  const double portal = city_end - axis.at(0.0).position.x() + 10.0;
  add_country_road(&b, materials, axis, grid.ground, portal - 10.0, portal + 0.5);
  add_road_tunnel(&b, materials, axis, grid.ground, portal, axis.length() - 20.0);
  const Route way(parallel_points(axis, 0.0, axis.length(), -kLaneOffset, 12.0), 20.0, false);
  Place place;
  constexpr double kStart = kOuterRoad + 12.0;  // behind the first crossing
  place.trajectory = std::make_unique<Trajectory>(
      drive(way, grid.ground, scenario.motion, kStart, scenario.duration_s, seed));
  place.tunnel_begin_x_m = axis.at(portal).position.x();
  add_city_traffic(&b, materials, grid, way, kStart, scenario.motion, *place.trajectory);
  place.world = b.finish();
  return place;
}

}  // namespace fdi_lio::simulation
