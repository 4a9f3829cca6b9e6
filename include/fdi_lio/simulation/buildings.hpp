#pragma once

#include <Eigen/Core>

#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

/// One house of a row.
struct BuildingLot {
  Eigen::Vector2d front_left;  ///< of the front wall, seen from the street
  Eigen::Vector2d front_right;
  double base_z = 0.0;  ///< height of the pavement at the front, metres
  double depth = 12.0;
  double height = 14.0;
};

/// A house with windows that lie back in the wall, ledges, a door or shop front, and sometimes balconies and
/// bays; style and dimensions are drawn from the builder's random stream.
void add_building(WorldBuilder* builder, const BuildingLot& lot);

}  // namespace fdi_lio::simulation
