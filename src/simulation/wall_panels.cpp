#include "fdi_lio/simulation/wall_panels.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::simulation {

namespace {

/// Draws in the wall's frame: x along, y into the wall, z up.
class Wall {
 public:
  Wall(WorldBuilder* builder, const WallStyle& style, const Eigen::Vector2d& a, const Eigen::Vector2d& b)
      : b_(builder), style_(style), length_((b - a).norm()) {
    T_map_wall_ = pose_at(a.x(), a.y(), 0.0, std::atan2(b.y() - a.y(), b.x() - a.x()));
  }

  void build() {
    constexpr double kDoorWidth = 0.95;
    double x = 0.0;
    if (style_.door_spacing > 0.0) {
      for (double door = 0.5 * style_.door_spacing; door + kDoorWidth < length_;
           door += style_.door_spacing) {
        bay(x, door);
        add_door(door, door + kDoorWidth);
        x = door + kDoorWidth;
      }
    }
    bay(x, length_);
  }

 private:
  Eigen::Vector3d at(double x, double y, double z) const { return T_map_wall_ * Eigen::Vector3d(x, y, z); }

  void panel(double x0, double x1, double z0, double z1, double y, MaterialId material) {
    add_quad(&b_->mesh, at(x0, y, z0), at(x1, y, z0), at(x1, y, z1), at(x0, y, z1), material, {x0, z0});
  }

  void block(double x, double y, double z, const Eigen::Vector3d& size, MaterialId material) {
    Eigen::Isometry3d T = T_map_wall_;
    T.translate(Eigen::Vector3d(x, y, z));
    add_box(&b_->mesh, T, size, material);
  }

  /// Wall between two doors: plain, with a glass pane, or with a notice board.
  void bay(double x0, double x1) {
    const double margin = 0.4, width = x1 - x0;
    const double draw = b_->random.uniform();
    if (width > 1.6 && draw < style_.glass_share) {
      panel(x0, x0 + margin, 0.0, style_.height, 0.0, style_.wall);
      panel(x1 - margin, x1, 0.0, style_.height, 0.0, style_.wall);
      panel(x0 + margin, x1 - margin, 0.0, 0.3, 0.0, style_.wall);
      panel(x0 + margin, x1 - margin, 2.2, style_.height, 0.0, style_.wall);
      panel(x0 + margin, x1 - margin, 0.3, 2.2, 0.03, style_.glass);
      panel(x0, x1, 0.0, style_.height, 4.0, style_.wall);  // the far wall of the room behind
      return;
    }
    panel(x0, x1, 0.0, style_.height, 0.0, style_.wall);
    if (width > 1.6 && draw < style_.glass_share + style_.poster_share) {
      const double board = b_->random.uniform(0.6, std::min(1.8, width - 0.6));
      const double middle = b_->random.uniform(x0 + 0.5 * board + 0.1, x1 - 0.5 * board - 0.1);
      block(middle, -0.015, b_->random.uniform(1.4, 1.7), {board, 0.03, b_->random.uniform(0.4, 0.9)},
            style_.poster);
    }
  }

  void add_door(double x0, double x1) {
    constexpr double kDoorHeight = 2.05;
    const double recess = style_.door_recess;
    panel(x0, x1, kDoorHeight, style_.height, 0.0, style_.wall);
    panel(x0, x1, 0.0, kDoorHeight, recess, style_.door);
    if (recess < 0.01) return;
    for (const double x : {x0, x1}) {
      add_quad(&b_->mesh, at(x, 0, 0), at(x, recess, 0), at(x, recess, kDoorHeight), at(x, 0, kDoorHeight),
               style_.frame);
      block(x, -0.01, 0.5 * kDoorHeight, {0.08, 0.02, kDoorHeight}, style_.frame);
    }
    add_quad(&b_->mesh, at(x0, 0, kDoorHeight), at(x1, 0, kDoorHeight), at(x1, recess, kDoorHeight),
             at(x0, recess, kDoorHeight), style_.frame);
    block(x0 + 0.1, recess - 0.04, 1.05, {0.14, 0.06, 0.03}, style_.frame);
  }

  WorldBuilder* b_;
  const WallStyle& style_;
  double length_;
  Eigen::Isometry3d T_map_wall_;
};

}  // namespace

WallStyle draw_wall_style(WorldBuilder* b, double height) {
  Random& r = b->random;
  WallStyle style{};
  Material wall;
  wall.texture = Texture::kPlaster;
  wall.reflectivity = static_cast<float>(r.uniform(0.55, 0.8));
  wall.contrast = 0.15f;
  style.wall = b->add_material(wall);
  style.door = b->mottled(r.uniform(0.15, 0.5), 0.05, 1.0);
  style.frame = b->mottled(r.uniform(0.3, 0.6), 0.05, 1.0);
  Material glass;
  glass.reflectivity = 0.06f;
  glass.mirror_share = 0.35f;
  glass.pass_share = 0.55f;
  style.glass = b->add_material(glass);
  Material poster;
  poster.texture = Texture::kChecker;
  poster.reflectivity = 0.8f;
  poster.contrast = 0.7f;
  poster.scale_m = 0.21f;
  style.poster = b->add_material(poster);
  style.height = height;
  style.door_spacing = r.uniform(3.4, 5.2);
  style.door_recess = 0.1 * b->settings.relief;
  style.glass_share = 0.12;
  style.poster_share = 0.25 * b->settings.marks;
  return style;
}

void add_indoor_wall(WorldBuilder* builder, const WallStyle& style, const Eigen::Vector2d& a,
                     const Eigen::Vector2d& b) {
  Wall(builder, style, a, b).build();
}

}  // namespace fdi_lio::simulation
