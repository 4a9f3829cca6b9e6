#include "fdi_lio/common/error.hpp"
#include "fdi_lio/simulation/worlds.hpp"

namespace fdi_lio::simulation {

Place make_place(const Scenario& scenario, std::uint64_t seed) {
  const std::string& type = scenario.world.type;
  if (scenario.motion.type == "kitti") {
    if (type != "street")
      throw Error("motion.type kitti needs world.type street: houses are set along the poses");
    return make_kitti_city(scenario, seed);
  }
  if (type == "street") return make_street(scenario, seed);
  if (type == "tunnel") return make_tunnel(scenario, seed);
  if (type == "street_tunnel") return make_street_tunnel(scenario, seed);
  if (type == "plaza") return make_plaza(scenario, seed);
  if (type == "highway") return make_highway(scenario, seed);
  if (type == "corridor") return make_corridor(scenario, seed);
  if (type == "mine") return make_mine(scenario, seed);
  if (type == "forest") return make_forest(scenario, seed);
  if (type == "handheld") return make_handheld(scenario, seed);
  throw Error("unknown world type '" + type + "'");
}

}  // namespace fdi_lio::simulation
