#include "fdi_lio/simulation/buildings.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::simulation {

namespace {

/// What the parts of one facade are made of and how they are spaced.
struct Style {
  MaterialId wall, glass, frame, ground_floor;
  double floor_height, window_spacing, window_width, window_height, window_depth, ledge, sill;
  bool balconies, shop;
};

MaterialId draw_wall(WorldBuilder* b) {
  Material wall;
  const double draw = b->random.uniform();
  wall.texture = draw < 0.3 ? Texture::kBricks : (draw < 0.85 ? Texture::kMottled : Texture::kPaving);
  wall.reflectivity = static_cast<float>(b->random.uniform(0.2, 0.65));
  wall.contrast = static_cast<float>(b->random.uniform(0.08, 0.3));
  wall.scale_m = static_cast<float>(b->random.uniform(0.8, 3.0));
  return b->add_material(wall);
}

Style draw_style(WorldBuilder* b) {
  Random& r = b->random;
  Style style{};
  style.wall = draw_wall(b);
  style.ground_floor = r.chance(0.4) ? draw_wall(b) : style.wall;
  Material glass;
  glass.reflectivity = 0.07f;
  glass.mirror_share = static_cast<float>(r.uniform(0.5, 0.8));
  style.glass = b->add_material(glass);
  style.frame = b->mottled(r.uniform(0.4, 0.75), 0.1, 0.5);
  style.floor_height = r.uniform(2.9, 3.7);
  style.window_spacing = r.uniform(2.2, 3.8);
  style.window_width = r.uniform(0.9, 1.5);
  style.window_height = r.uniform(1.3, 1.9);
  style.window_depth = r.uniform(0.1, 0.3) * b->settings.relief;
  style.ledge = r.chance(0.6) ? r.uniform(0.05, 0.25) * b->settings.relief : 0.0;
  style.sill = r.uniform(0.04, 0.15) * b->settings.relief;
  style.balconies = r.chance(0.3);
  style.shop = r.chance(0.35);
  return style;
}

/// Draws in a facade's frame: x along the wall (to the right seen from inside), y into the house, z up.
class Facade {
 public:
  Facade(WorldBuilder* builder, const BuildingLot& lot, const Style& style)
      : b_(builder), style_(style), width_((lot.front_right - lot.front_left).norm()) {
    const Eigen::Vector2d along = (lot.front_right - lot.front_left) / width_;
    Eigen::Matrix3d R;
    R.col(0) = Eigen::Vector3d(along.x(), along.y(), 0.0);
    R.col(1) = Eigen::Vector3d(-along.y(), along.x(), 0.0);
    R.col(2) = Eigen::Vector3d::UnitZ();
    T_map_facade_.linear() = R;
    T_map_facade_.translation() << lot.front_left, lot.base_z;
  }

  void build(const BuildingLot& lot) {
    const int floors = std::max(2, static_cast<int>(std::floor(lot.height / style_.floor_height)));
    const int bays = std::max(1, static_cast<int>(std::floor(width_ / style_.window_spacing)));
    const double bay = width_ / bays;
    const int door = b_->random.index(bays);
    const double top = floors * style_.floor_height;
    panel(0.0, width_, -1.5, 0.0, 0.0, style_.ground_floor);
    for (int floor = 0; floor < floors; ++floor) {
      const double bottom = floor * style_.floor_height;
      for (int i = 0; i < bays; ++i) opening(i * bay, bay, bottom, floor, floor == 0 && i == door);
      if (floor > 0 && style_.ledge > 0.0)
        block(0.5 * width_, -0.5 * style_.ledge, bottom, width_, style_.ledge, 0.25);
    }
    const double eaves = b_->random.uniform(0.15, 0.5);
    block(0.5 * width_, -0.5 * eaves, top, width_, eaves, 0.3);
    shell(lot.depth, top);
  }

 private:
  /// Vertical rectangle parallel to the wall, `y` metres behind it.
  void panel(double x0, double x1, double z0, double z1, double y, MaterialId material) {
    quad({x0, y, z0}, {x1, y, z0}, {x1, y, z1}, {x0, y, z1}, material, {x0, z0});
  }

  void quad(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
            const Eigen::Vector3d& d, MaterialId material,
            const Eigen::Vector2d& uv = Eigen::Vector2d::Zero()) {
    add_quad(&b_->mesh, T_map_facade_ * a, T_map_facade_ * b, T_map_facade_ * c, T_map_facade_ * d, material,
             uv);
  }

  void block(double x, double y, double z, double size_x, double size_y, double size_z) {
    Eigen::Isometry3d T = T_map_facade_;
    T.translate(Eigen::Vector3d(x, y, z));
    add_box(&b_->mesh, T, Eigen::Vector3d(size_x, size_y, size_z), style_.frame);
  }

  /// One bay of one floor: wall with a hole, its reveals, and what closes it.
  void opening(double x, double bay, double z, int floor, bool door) {
    const bool shop = floor == 0 && style_.shop && !door;
    const double width = std::min(door ? 1.1 : (shop ? bay - 0.5 : style_.window_width), bay - 0.3);
    const double height = door ? 2.2 : (shop ? 2.2 : style_.window_height);
    const double sill = door ? 0.0 : (shop ? 0.4 : 0.9);
    const double depth = door ? 0.35 : style_.window_depth;
    const double x0 = x + 0.5 * (bay - width), x1 = x0 + width;
    const double z0 = z + sill, z1 = std::min(z0 + height, z + style_.floor_height - 0.2);
    const double top = z + style_.floor_height;
    const MaterialId wall = floor == 0 ? style_.ground_floor : style_.wall;
    panel(x, x0, z, top, 0.0, wall);
    panel(x1, x + bay, z, top, 0.0, wall);
    if (sill > 0.0) panel(x0, x1, z, z0, 0.0, wall);
    panel(x0, x1, z1, top, 0.0, wall);
    const bool closed = !door && !shop && b_->random.chance(0.3);  // blinds, curtains
    panel(x0, x1, z0, z1, depth, door || closed ? style_.frame : style_.glass);
    quad({x0, 0, z0}, {x0, depth, z0}, {x0, depth, z1}, {x0, 0, z1}, style_.frame);
    quad({x1, depth, z0}, {x1, 0, z0}, {x1, 0, z1}, {x1, depth, z1}, style_.frame);
    quad({x0, 0, z0}, {x1, 0, z0}, {x1, depth, z0}, {x0, depth, z0}, style_.frame);
    quad({x0, depth, z1}, {x1, depth, z1}, {x1, 0, z1}, {x0, 0, z1}, style_.frame);
    if (!closed && !door)
      panel(x0 + 0.5 * width - 0.04, x0 + 0.5 * width + 0.04, z0, z1, depth - 0.02, style_.frame);
    if (!door && style_.sill > 0.01)
      block(0.5 * (x0 + x1), -0.5 * style_.sill, z0 - 0.04, width + 0.2, style_.sill, 0.08);
    if (shop) block(x + 0.5 * bay, -0.15, z + 2.85, bay, 0.3, 0.4);
    if (style_.balconies && floor > 0 && b_->random.chance(0.5)) balcony(x, bay, z);
  }

  void balcony(double x, double bay, double z) {
    const double depth = 1.0;
    const double width = bay - 0.3;
    block(x + 0.5 * bay, -0.5 * depth, z, width, depth, 0.18);
    if (b_->random.chance(0.4)) {
      block(x + 0.5 * bay, -depth + 0.04, z + 0.55, width, 0.08, 0.9);  // solid parapet
      return;
    }
    block(x + 0.5 * bay, -depth + 0.03, z + 1.0, width, 0.06, 0.05);
    const int bars = static_cast<int>(width / 0.25);
    for (int i = 0; i <= bars; ++i) {
      block(x + 0.15 + width * i / bars, -depth + 0.03, z + 0.55, 0.03, 0.03, 0.9);
    }
  }

  /// Side and back walls and the roof.
  void shell(double depth, double top) {
    const auto wall = style_.wall;
    quad({0, depth, -1.5}, {0, 0, -1.5}, {0, 0, top}, {0, depth, top}, wall);
    quad({width_, 0, -1.5}, {width_, depth, -1.5}, {width_, depth, top}, {width_, 0, top}, wall);
    panel(0.0, width_, -1.5, top, depth, wall);
    const double ridge = b_->random.chance(0.6) ? b_->random.uniform(1.5, 4.0) : 0.3;
    const double half = 0.5 * depth;
    quad({0, 0, top}, {width_, 0, top}, {width_, half, top + ridge}, {0, half, top + ridge},
         style_.ground_floor);
    quad({0, half, top + ridge}, {width_, half, top + ridge}, {width_, depth, top}, {0, depth, top},
         style_.ground_floor);
  }

  WorldBuilder* b_;
  Style style_;
  double width_;
  Eigen::Isometry3d T_map_facade_ = Eigen::Isometry3d::Identity();
};

}  // namespace

void add_building(WorldBuilder* builder, const BuildingLot& lot) {
  const Style style = draw_style(builder);
  Facade(builder, lot, style).build(lot);
}

}  // namespace fdi_lio::simulation
