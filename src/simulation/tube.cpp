#include "fdi_lio/simulation/tube.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/simulation/sweep.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kWalkway = 0.9;  // metres
constexpr double kWalkwayHeight = 0.25;
constexpr double kStep = 2.0;  // metres between stations of the swept surfaces

struct Niche {
  double s;
  double side;  ///< +1 left, -1 right
};
constexpr double kNicheHalfLength = 1.6;
constexpr double kNicheDepth = 1.4;
constexpr double kNicheHeight = 2.4;

/// Draws one tunnel; keeps what all its parts need.
class TunnelBuilder {
 public:
  TunnelBuilder(WorldBuilder* b, const PropMaterials& m, const Route& centre, const Ground& ground,
                double begin, double end)
      : b_(b), m_(m), centre_(centre), ground_(ground), begin_(begin), end_(end) {
    Random& r = b->random;
    half_ = 0.5 * b->settings.width_m;
    spring_ = std::min(kNicheHeight + 0.2, 0.5 * b->settings.height_m + 0.3);
    Material lining;
    lining.texture = Texture::kLining;
    lining.reflectivity = static_cast<float>(r.uniform(0.22, 0.45));
    lining.contrast = static_cast<float>(r.uniform(0.03, 0.1));
    lining.scale_m = static_cast<float>(r.uniform(4.0, 12.5));
    lining_left_ = b->add_material(lining);
    lining_right_ = b->add_material(lining);
    Material road;
    road.texture = Texture::kRoad;
    road.reflectivity = static_cast<float>(r.uniform(0.15, 0.25));
    road.contrast = 0.25f;
    road.half_width_m = static_cast<float>(half_ - kWalkway + 1.9);  // puts the edge lines near the walkways
    road_ = b->add_material(road);
  }

  void build() {
    draw_niches();
    add_walls();
    add_floor();
    for (const Niche& niche : niches_) add_niche(niche);
    add_fittings();
    add_portal(begin_);
    add_portal(end_);
  }

 private:
  void draw_niches() {
    Random& r = b_->random;
    double side = r.chance(0.5) ? 1.0 : -1.0;
    for (double s = begin_ + r.uniform(30.0, 60.0); s < end_ - 20.0; s += r.uniform(55.0, 90.0)) {
      side = -side;
      if (r.chance(0.7 * std::min(1.0, b_->settings.relief))) niches_.push_back({s, side});
    }
  }

  /// Stretches of a side's lower wall between its niches.
  std::vector<std::pair<double, double>> stretches(double side) const {
    std::vector<std::pair<double, double>> result;
    double from = begin_;
    for (const Niche& niche : niches_) {
      if (niche.side != side) continue;
      result.emplace_back(from, niche.s - kNicheHalfLength);
      from = niche.s + kNicheHalfLength;
    }
    result.emplace_back(from, end_);
    return result;
  }

  void add_walls() {
    for (const double side : {1.0, -1.0}) {
      const MaterialId lining = side > 0.0 ? lining_left_ : lining_right_;
      for (const auto& [from, to] : stretches(side)) {
        sweep(&b_->mesh, centre_, ground_, stations(from, to, kStep),
              {{side * half_, kWalkwayHeight}, {side * half_, spring_}}, lining, kWalkwayHeight);
      }
      std::vector<ProfilePoint> vault;
      constexpr int kSegments = 14;
      for (int i = 0; i <= kSegments; ++i) {
        const double angle = 0.5 * M_PI * i / kSegments;
        vault.push_back(
            {side * half_ * std::cos(angle), spring_ + (b_->settings.height_m - spring_) * std::sin(angle)});
      }
      sweep(&b_->mesh, centre_, ground_, stations(begin_, end_, kStep), vault, lining, spring_);
    }
  }

  void add_floor() {
    const double kerb = half_ - kWalkway;
    sweep(&b_->mesh, centre_, ground_, stations(begin_, end_, kStep), {{-kerb, 0.0}, {kerb, 0.0}}, road_,
          -kerb);
    for (const double side : {1.0, -1.0}) {
      sweep(&b_->mesh, centre_, ground_, stations(begin_, end_, kStep),
            {{side * kerb, -0.05}, {side * kerb, kWalkwayHeight}, {side * (half_ + 0.01), kWalkwayHeight}},
            m_.concrete);
    }
  }

  void add_niche(const Niche& n) {
    const double back = n.side * (half_ + kNicheDepth), front = n.side * half_;
    const double s0 = n.s - kNicheHalfLength, s1 = n.s + kNicheHalfLength;
    const auto at = [&](double s, double left, double up) { return beside(centre_, ground_, s, left, up); };
    const MaterialId wall = m_.concrete;
    add_quad(&b_->mesh, at(s0, back, 0.0), at(s1, back, 0.0), at(s1, back, kNicheHeight),
             at(s0, back, kNicheHeight), wall);
    for (const double s : {s0, s1}) {
      add_quad(&b_->mesh, at(s, front, 0.0), at(s, back, 0.0), at(s, back, spring_), at(s, front, spring_),
               wall);
    }
    add_quad(&b_->mesh, at(s0, front, kWalkwayHeight), at(s1, front, kWalkwayHeight),
             at(s1, back, kWalkwayHeight), at(s0, back, kWalkwayHeight), wall);
    sweep(&b_->mesh, centre_, ground_, {s0, s1},
          {{front, spring_}, {front, kNicheHeight}, {back, kNicheHeight}}, wall);
    box(n.s, back - n.side * 0.2, 1.0, {0.6, 0.35, 0.9}, m_.metal);
  }

  void box(double s, double left, double up, const Eigen::Vector3d& size, MaterialId material) {
    add_box(&b_->mesh, pose_beside(centre_, ground_, s, left, up), size, material);
  }

  void add_fittings() {
    Random& r = b_->random;
    const double marks = b_->settings.marks;
    const double side = r.chance(0.5) ? 1.0 : -1.0;
    // A cable tray and a hand rail are smooth along the axis like the wall itself.
    sweep(&b_->mesh, centre_, ground_, stations(begin_, end_, kStep),
          {{side * (half_ - 0.01), spring_ + 0.3},
           {side * (half_ - 0.3), spring_ + 0.3},
           {side * (half_ - 0.3), spring_ + 0.4}},
          m_.metal);
    const double light_spacing = r.uniform(10.0, 14.0);
    for (double s = begin_ + 5.0; s < end_ && r.chance(marks > 0.3 ? 1.0 : 0.0); s += light_spacing) {
      box(s, 0.0, b_->settings.height_m - 0.12, {1.3, 0.25, 0.14}, m_.lamp);
    }
    for (double s = begin_ + r.uniform(10.0, 25.0); s < end_; s += r.uniform(20.0, 32.0)) {
      if (!r.chance(marks)) continue;
      const double where = (r.chance(0.5) ? 1.0 : -1.0) * (half_ - 0.03);
      box(s, where, r.uniform(1.0, 2.0), {0.6, 0.02, 0.35}, m_.sign_front);  // escape-route sign
    }
    for (double s = begin_ + r.uniform(20.0, 50.0); s < end_; s += r.uniform(40.0, 70.0)) {
      if (r.chance(marks))
        box(s, -side * (half_ - 0.12), 0.9, {0.7, 0.22, 0.9}, m_.metal);  // hydrant cabinet
    }
    for (double s = begin_ + r.uniform(40.0, 90.0); s < end_; s += r.uniform(110.0, 180.0)) {
      if (r.chance(0.6 * marks)) jet_fan(s, r.uniform(-1.0, 1.0));
    }
  }

  void jet_fan(double s, double left) {
    const double up = b_->settings.height_m - 0.75;
    add_tube(&b_->mesh, beside(centre_, ground_, s - 1.6, left, up),
             beside(centre_, ground_, s + 1.6, left, up), 0.4, 0.4, 14, m_.metal, true);
  }

  /// Wall across the road with the tunnel's opening.
  void add_portal(double s) {
    constexpr double kReach = 25.0;
    const double top = b_->settings.height_m + 3.0;
    const auto at = [&](double left, double up) { return beside(centre_, ground_, s, left, up); };
    const MaterialId wall = b_->mottled(b_->random.uniform(0.25, 0.4), 0.2, 2.0);
    for (const double side : {1.0, -1.0}) {
      add_quad(&b_->mesh, at(side * half_, -1.0), at(side * kReach, -1.0), at(side * kReach, top),
               at(side * half_, top), wall);
    }
    constexpr int kSegments = 16;
    add_grid(&b_->mesh, kSegments, 1, wall, [&](int column, int row) {
      const double angle = M_PI * column / kSegments;
      const double left = half_ * std::cos(angle);
      const double arch = spring_ + (b_->settings.height_m - spring_) * std::sin(angle);
      const double up = row == 0 ? arch : top;
      return SurfacePoint{at(left, up), {left, up}};
    });
  }

  WorldBuilder* b_;
  const PropMaterials& m_;
  const Route& centre_;
  const Ground& ground_;
  double begin_, end_, half_, spring_;
  MaterialId lining_left_, lining_right_, road_;
  std::vector<Niche> niches_;
};

}  // namespace

void add_road_tunnel(WorldBuilder* b, const PropMaterials& m, const Route& centre, const Ground& ground,
                     double begin, double end) {
  TunnelBuilder(b, m, centre, ground, begin, end).build();
}

void add_country_road(WorldBuilder* b, const PropMaterials& m, const Route& centre, const Ground& ground,
                      double begin, double end) {
  constexpr double kHalf = 4.2;
  Random& r = b->random;
  Material road;
  road.texture = Texture::kRoad;
  road.reflectivity = 0.22f;
  road.contrast = 0.3f;
  road.half_width_m = 6.0f;
  const MaterialId grass = b->mottled(0.4, 0.4, 1.5);
  const std::vector<double> at = stations(begin, end, 3.0);
  sweep(&b->mesh, centre, ground, at, {{-kHalf, 0.0}, {0.0, 0.0}, {kHalf, 0.0}}, b->add_material(road),
        -kHalf);
  for (const double side : {1.0, -1.0}) {
    std::vector<ProfilePoint> bank;
    for (double left = kHalf; left < 42.0; left += 3.0) {
      bank.push_back({side * left, -0.02 + std::max(0.0, left - 10.0) * 0.12 +
                                       (left > kHalf ? r.uniform(-0.1, 0.1) : 0.0)});
    }
    sweep(&b->mesh, centre, ground, at, bank, grass);
    for (double s = begin + r.uniform(2.0, 8.0); s < end; s += r.uniform(5.0, 12.0)) {
      const double left = side * r.uniform(10.0, 28.0);
      const Eigen::Vector3d foot = beside(centre, ground, s, left, (std::abs(left) - 10.0) * 0.12);
      if (r.chance(0.7 * std::min(1.0, b->settings.trees))) add_tree(b, m, foot, r.uniform(4.0, 9.0));
    }
    for (double s = begin + r.uniform(2.0, 10.0); s < end; s += 25.0) {
      add_tube(&b->mesh, beside(centre, ground, s, side * 4.9, 0.0),
               beside(centre, ground, s, side * 4.9, 1.0), 0.06, 0.06, 6, m.plate, true);
    }
  }
}

}  // namespace fdi_lio::simulation
