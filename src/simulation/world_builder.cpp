#include "fdi_lio/simulation/world_builder.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/simulation/random_streams.hpp"

namespace fdi_lio::simulation {

WorldBuilder::WorldBuilder(const WorldSettings& world_settings, std::uint64_t world_seed)
    : settings(world_settings), random(world_seed, kStreamWorld) {}

MaterialId WorldBuilder::add_material(Material material) {
  if (materials.size() >= std::numeric_limits<MaterialId>::max())
    throw Error("the world has too many materials");
  material.contrast = std::min(1.0f, material.contrast * static_cast<float>(settings.texture));
  material.seed = static_cast<std::uint32_t>(random.next());
  materials.push_back(material);
  return static_cast<MaterialId>(materials.size() - 1);
}

MaterialId WorldBuilder::mottled(double reflectivity, double contrast, double scale_m) {
  Material material;
  material.texture = Texture::kMottled;
  material.reflectivity = static_cast<float>(reflectivity);
  material.contrast = static_cast<float>(contrast);
  material.scale_m = static_cast<float>(scale_m);
  return add_material(material);
}

void WorldBuilder::add_object(MovingObject object) {
  object.id = static_cast<std::int16_t>(objects.size() + 1);
  objects.push_back(std::move(object));
}

std::unique_ptr<World> WorldBuilder::finish() {
  return std::make_unique<World>(std::move(mesh), std::move(materials), std::move(objects));
}

}  // namespace fdi_lio::simulation
