#include "fdi_lio/common/error.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

Place make_place(const Scenario& scenario, std::uint64_t seed) {
  const std::string& type = scenario.world.type;
  if (type == "street") return make_street(scenario, seed);
  throw Error("unknown world type '" + type + "'");
}

}  // namespace fdi_lio::simulation
