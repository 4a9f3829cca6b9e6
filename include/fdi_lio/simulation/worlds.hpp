#pragma once

#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

Place make_street(const Scenario& scenario, std::uint64_t seed);

}  // namespace fdi_lio::simulation
