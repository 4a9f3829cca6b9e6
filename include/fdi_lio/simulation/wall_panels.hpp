#pragma once

#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

/// What an indoor wall is made of; lengths in metres.
struct WallStyle {
  MaterialId wall, door, frame, glass, poster;
  double height = 2.7;
  double door_spacing = 4.0;  ///< 0: no doors
  double door_recess = 0.1;   ///< how far doors lie back
  double glass_share = 0.1;   ///< of the bays between doors that are glass panes
  double poster_share = 0.2;  ///< of the bays that carry a notice board
};

/// Draws materials and dimensions of an indoor wall.
WallStyle draw_wall_style(WorldBuilder* builder, double height);

/// Indoor wall from `a` to `b`; the room is on the right. Doors repeat at equal distances.
void add_indoor_wall(WorldBuilder* builder, const WallStyle& style, const Eigen::Vector2d& a,
                     const Eigen::Vector2d& b);

}  // namespace fdi_lio::simulation
