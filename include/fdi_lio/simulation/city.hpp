#pragma once

#include <vector>

#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

/// Streets on a grid: centre lines at x = xs[i] (running along y) and y = ys[j] (running along x).
struct CityGrid {
  std::vector<double> xs, ys;
  std::vector<double> half_x, half_y;  ///< from the centre line to the kerb, metres
  double pavement = 3.0;               ///< width of the pavement, metres
  double kerb = 0.12;                  ///< height of the kerb, metres
  Ground ground;                       ///< height of the road
};

constexpr double kLaneOffset = 1.7;  ///< from the centre line of a street to the lane driven on, metres

/// Gently rolling ground of `amplitude` metres.
Ground make_rolling_ground(double amplitude, Random* random);

/// Draws block sizes and street widths for `columns` x `rows` blocks; one street centre line is x = 0, one y
/// = 0.
CityGrid draw_city_grid(WorldBuilder* builder, int columns, int rows, int origin_column, int origin_row);

/// Roads with lane paint, crossings, pavements with kerbs, and the ground inside the blocks.
void add_city_ground(WorldBuilder* builder, const CityGrid& grid);

/// Rows of houses along all blocks, with gaps between some.
void add_city_buildings(WorldBuilder* builder, const CityGrid& grid);

/// Parked cars, trees, lamps, signs and furniture along all streets.
void add_city_furniture(WorldBuilder* builder, const PropMaterials& materials, const CityGrid& grid);

/// Moving cars and people; the sensor starts at arc length `start` of the route. Those that would come near
/// the sensor's own way are left out.
void add_city_traffic(WorldBuilder* builder, const PropMaterials& materials, const CityGrid& grid,
                      const Route& route, double start, const MotionSettings& motion,
                      const Trajectory& trajectory);

}  // namespace fdi_lio::simulation
