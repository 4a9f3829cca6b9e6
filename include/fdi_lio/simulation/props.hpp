#pragma once

#include <functional>
#include <memory>

#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {

/// Materials that many props share.
struct PropMaterials {
  explicit PropMaterials(WorldBuilder* builder);

  MaterialId bark, leaves, metal, concrete, sign_front, sign_back, rubber, window, plate, lamp, clothes_dark,
      clothes_light, skin;
};

/// A broad-leaved tree: trunk, some branches, and a crown of loose leaves that lets part of the rays through.
void add_tree(WorldBuilder* builder, const PropMaterials& materials, const Eigen::Vector3d& foot,
              double height);

/// A pole with a plate; `yaw` is where the plate looks.
void add_sign(WorldBuilder* builder, const PropMaterials& materials, const Eigen::Vector3d& foot, double yaw);

/// A lamp post whose arm reaches out along `yaw`.
void add_lamp_post(WorldBuilder* builder, const PropMaterials& materials, const Eigen::Vector3d& foot,
                   double yaw);

/// A low thing that stands about in streets: bin, bollard, switch box, planter or bench.
void add_street_furniture(WorldBuilder* builder, const PropMaterials& materials, const Eigen::Vector3d& foot,
                          double yaw);

enum class CarKind { kCompact, kEstate, kVan, kTruck };

/// A car around the origin, wheels on z = 0, front along x.
Mesh make_car(WorldBuilder* builder, const PropMaterials& materials, CarKind kind);

/// Kinds as frequent as in a city.
CarKind draw_car_kind(Random* random);

/// A moving car; `T_map_object` gives the pose of its footprint's centre.
MovingObject make_moving_car(WorldBuilder* builder, const PropMaterials& materials, CarKind kind,
                             std::function<Eigen::Isometry3d(double)> T_map_object);

/// Rigid pieces of a person, shared by all walkers of a world.
class WalkerShapes {
 public:
  WalkerShapes(WorldBuilder* builder, const PropMaterials& materials);

  /// A person whose feet are at the pose's origin and who walks along its x axis at `speed` m/s (0: stands).
  MovingObject make(double speed, Random* random,
                    std::function<Eigen::Isometry3d(double)> T_map_object) const;

 private:
  std::vector<std::shared_ptr<const RayMesh>> bodies_;
  std::shared_ptr<const RayMesh> leg_, arm_;
};

/// A person who walks up and down between two points with rounded turns; starts anywhere in between.
std::function<Eigen::Isometry3d(double)> walk_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                                      double speed, double start_phase);

}  // namespace fdi_lio::simulation
