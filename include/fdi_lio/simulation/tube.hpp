#pragma once

#include "fdi_lio/simulation/props.hpp"
#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

/// A road tunnel along `centre` from arc length `begin` to `end`: smooth horseshoe lining, two lanes with
/// paint, raised walkways, niches, lights, cables, signs and hydrant boxes, and a portal wall at each end.
/// Between the fittings its geometry says nothing along the axis. Uses width, height, relief (niches), marks
/// (fittings) of the settings.
void add_road_tunnel(WorldBuilder* builder, const PropMaterials& materials, const Route& centre,
                     const Ground& ground, double begin, double end);

/// Grass, some trees, posts and a road from `begin` to `end` of `centre`, for the open country before a
/// portal.
void add_country_road(WorldBuilder* builder, const PropMaterials& materials, const Route& centre,
                      const Ground& ground, double begin, double end);

}  // namespace fdi_lio::simulation
