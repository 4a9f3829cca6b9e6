#pragma once

#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

// One function a world type: draws the place, the way through it and what moves there.

Place make_street(const Scenario& scenario, std::uint64_t seed);
Place make_kitti_city(const Scenario& scenario, std::uint64_t seed);
Place make_tunnel(const Scenario& scenario, std::uint64_t seed);
Place make_street_tunnel(const Scenario& scenario, std::uint64_t seed);
Place make_plaza(const Scenario& scenario, std::uint64_t seed);
Place make_highway(const Scenario& scenario, std::uint64_t seed);
Place make_corridor(const Scenario& scenario, std::uint64_t seed);
Place make_mine(const Scenario& scenario, std::uint64_t seed);
Place make_forest(const Scenario& scenario, std::uint64_t seed);
Place make_handheld(const Scenario& scenario, std::uint64_t seed);

}  // namespace fdi_lio::simulation
