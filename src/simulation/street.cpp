#include <algorithm>

#include "fdi_lio/simulation/city.hpp"
#include "fdi_lio/simulation/random_streams.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kLeftTurnRadius = 12.0;
constexpr double kRightTurnRadius = 7.5;

/// A loop round one or two blocks in the right-hand lane, either way round, sometimes round an L of three.
Route draw_loop(const CityGrid& g, Random* random) {
  const bool left_handed = random->chance(0.5);  // counter-clockwise: left turns
  const double out = left_handed ? kLaneOffset : -kLaneOffset;
  const int shape = random->index(3);
  const double x0 = g.xs[1] - out, y0 = g.ys[1] - out;
  const double x1 = g.xs[2] + out, x2 = g.xs[3] + out, y1 = g.ys[2] + out, y2 = g.ys[3] + out;
  std::vector<Eigen::Vector2d> corners;
  if (shape == 0) corners = {{x0, y0}, {x2, y0}, {x2, y1}, {x0, y1}};
  if (shape == 1) corners = {{x0, y0}, {x1, y0}, {x1, y2}, {x0, y2}};
  if (shape == 2) corners = {{x0, y0}, {x2, y0}, {x2, y1}, {x1, y1}, {x1, y2}, {x0, y2}};
  if (!left_handed) std::reverse(corners.begin(), corners.end());
  return Route(corners, left_handed ? kLeftTurnRadius : kRightTurnRadius, true);
}

}  // namespace

Place make_street(const Scenario& scenario, std::uint64_t seed) {
  WorldBuilder builder(scenario.world, seed);
  const PropMaterials materials(&builder);
  const CityGrid grid = draw_city_grid(&builder, 4, 4, 1, 1);
  add_city_ground(&builder, grid);
  add_city_buildings(&builder, grid);
  add_city_furniture(&builder, materials, grid);
  const Route route = draw_loop(grid, &builder.random);
  constexpr double kStart = 25.0;  // metres after the first corner
  Place place;
  place.trajectory = std::make_unique<Trajectory>(
      drive(route, grid.ground, scenario.motion, kStart, scenario.duration_s, seed));
  add_city_traffic(&builder, materials, grid, route, kStart, scenario.motion, *place.trajectory);
  place.world = builder.finish();
  return place;
}

}  // namespace fdi_lio::simulation
