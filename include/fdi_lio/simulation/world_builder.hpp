#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"
#include "fdi_lio/simulation/world.hpp"

namespace fdi_lio::simulation {

/// Collects what a world is made of.
struct WorldBuilder {
  WorldBuilder(const WorldSettings& world_settings, std::uint64_t world_seed);

  /// Registers a material; its texture contrast is scaled by the settings, its seed is drawn.
  MaterialId add_material(Material material);

  /// Diffuse material of one tone with stains.
  MaterialId mottled(double reflectivity, double contrast, double scale_m);

  void add_object(MovingObject object);

  /// Builds the acceleration structure; the builder is empty afterwards.
  std::unique_ptr<World> finish();

  WorldSettings settings;
  Random random;
  Mesh mesh;
  std::vector<Material> materials;
  std::vector<MovingObject> objects;
};

/// A built world and the way through it.
struct Place {
  std::unique_ptr<World> world;
  std::unique_ptr<Trajectory> trajectory;
  /// Where the surroundings change their kind on the way: beyond this x of the map the way is in a tunnel.
  std::optional<double> tunnel_begin_x_m = std::nullopt;
};

/// Draws the place of a scenario. Same scenario and seed, same place.
Place make_place(const Scenario& scenario, std::uint64_t seed);

}  // namespace fdi_lio::simulation
