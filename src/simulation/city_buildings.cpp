#include <cmath>

#include "fdi_lio/simulation/buildings.hpp"
#include "fdi_lio/simulation/city.hpp"

namespace fdi_lio::simulation {

namespace {

/// Houses from `a` to `b` (left to right seen from the street), with alleys and yards between some.
void add_row(WorldBuilder* builder, const CityGrid& grid, const Eigen::Vector2d& a,
             const Eigen::Vector2d& b) {
  Random& r = builder->random;
  const Eigen::Vector2d along = (b - a).normalized();
  const Eigen::Vector2d inward(-along.y(), along.x());
  const double length = (b - a).norm();
  const double usual_height = r.uniform(9.0, 20.0);
  const bool gardens = r.chance(0.25);  // houses stand back from the pavement
  double position = 0.0;
  while (position < length - 6.0) {
    if (r.chance(0.18)) position += r.uniform(2.5, 9.0);
    const double width = std::min(r.uniform(9.0, 24.0), length - position);
    if (width < 6.0) break;
    const double setback = gardens ? r.uniform(1.5, 6.0) : (r.chance(0.3) ? r.uniform(0.2, 1.8) : 0.0);
    BuildingLot lot;
    lot.front_left = a + position * along + setback * inward;
    lot.front_right = lot.front_left + width * along;
    lot.depth = r.uniform(9.0, 13.0);
    lot.height = usual_height * r.uniform(0.7, 1.25);
    const Eigen::Vector2d middle = 0.5 * (lot.front_left + lot.front_right);
    lot.base_z = grid.ground(middle.x(), middle.y()) + grid.kerb;
    add_building(builder, lot);
    position += width;
  }
}

}  // namespace

void add_city_buildings(WorldBuilder* b, const CityGrid& g) {
  for (std::size_t i = 0; i + 1 < g.xs.size(); ++i) {
    for (std::size_t j = 0; j + 1 < g.ys.size(); ++j) {
      const double x0 = g.xs[i] + g.half_x[i] + g.pavement, x1 = g.xs[i + 1] - g.half_x[i + 1] - g.pavement;
      const double y0 = g.ys[j] + g.half_y[j] + g.pavement, y1 = g.ys[j + 1] - g.half_y[j + 1] - g.pavement;
      add_row(b, g, {x0, y0}, {x1, y0});
      add_row(b, g, {x1, y0}, {x1, y1});
      add_row(b, g, {x1, y1}, {x0, y1});
      add_row(b, g, {x0, y1}, {x0, y0});
    }
  }
}

}  // namespace fdi_lio::simulation
