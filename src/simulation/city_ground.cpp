#include <cmath>
#include <utility>

#include "fdi_lio/simulation/city.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kPatch = 3.0;  // metres between nodes of the ground's mesh

/// A rectangle of ground; `along_y`: texture u runs along y, v is x - centre (else the other way round).
struct Rectangle {
  double x0, x1, y0, y1;
  bool along_y;
  double centre;
};

void add_rectangle(WorldBuilder* b, const CityGrid& grid, const Rectangle& r, double lift,
                   MaterialId material) {
  if (r.x1 <= r.x0 || r.y1 <= r.y0) return;
  const int columns = std::max(1, static_cast<int>(std::ceil((r.x1 - r.x0) / kPatch)));
  const int rows = std::max(1, static_cast<int>(std::ceil((r.y1 - r.y0) / kPatch)));
  add_grid(&b->mesh, columns, rows, material, [&](int column, int row) {
    const double x = r.x0 + (r.x1 - r.x0) * column / columns;
    const double y = r.y0 + (r.y1 - r.y0) * row / rows;
    const Eigen::Vector2d uv =
        r.along_y ? Eigen::Vector2d(y, x - r.centre) : Eigen::Vector2d(x, y - r.centre);
    return SurfacePoint{{x, y, grid.ground(x, y) + lift}, uv};
  });
}

MaterialId road_material(WorldBuilder* b, Texture texture, double half_width) {
  Material road;
  road.texture = texture;
  road.reflectivity = static_cast<float>(b->random.uniform(0.18, 0.3));
  road.contrast = 0.3f;
  road.half_width_m = static_cast<float>(half_width);
  return b->add_material(road);
}

/// One street between two intersections: road with a zebra crossing at some of its ends.
void add_road(WorldBuilder* b, const CityGrid& grid, double begin, double end, double centre, double half,
              bool along_y) {
  constexpr double kCrossing = 3.5;
  const MaterialId road = road_material(b, Texture::kRoad, half);
  const MaterialId zebra = road_material(b, Texture::kCrossing, half);
  const double first = b->random.chance(0.5 * b->settings.marks) ? kCrossing : 0.0;
  const double last = b->random.chance(0.5 * b->settings.marks) ? kCrossing : 0.0;
  const auto piece = [&](double from, double to, MaterialId material) {
    const Rectangle r = along_y ? Rectangle{centre - half, centre + half, from, to, true, centre}
                                : Rectangle{from, to, centre - half, centre + half, false, centre};
    add_rectangle(b, grid, r, 0.0, material);
  };
  piece(begin, begin + first, zebra);
  piece(begin + first, end - last, road);
  piece(end - last, end, zebra);
}

/// Pavement, inner yard and the kerb round one block.
void add_block_ground(WorldBuilder* b, const CityGrid& grid, double x0, double x1, double y0, double y1) {
  Material slabs;
  slabs.texture = Texture::kPaving;
  slabs.reflectivity = static_cast<float>(b->random.uniform(0.28, 0.42));
  slabs.contrast = 0.15f;
  slabs.scale_m = 0.5f;
  const MaterialId paving = b->add_material(slabs);
  const MaterialId yard = b->mottled(0.35, 0.4, 2.0);
  const MaterialId stone = b->mottled(0.4, 0.1, 1.0);
  const double p = grid.pavement;
  add_rectangle(b, grid, {x0, x1, y0, y0 + p, false, y0}, grid.kerb, paving);
  add_rectangle(b, grid, {x0, x1, y1 - p, y1, false, y1}, grid.kerb, paving);
  add_rectangle(b, grid, {x0, x0 + p, y0 + p, y1 - p, true, x0}, grid.kerb, paving);
  add_rectangle(b, grid, {x1 - p, x1, y0 + p, y1 - p, true, x1}, grid.kerb, paving);
  add_rectangle(b, grid, {x0 + p, x1 - p, y0 + p, y1 - p, false, y0}, grid.kerb, yard);
  const Eigen::Vector2d corners[5] = {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}, {x0, y0}};
  for (int side = 0; side < 4; ++side) {
    const Eigen::Vector2d a = corners[side];
    const Eigen::Vector2d along = corners[side + 1] - a;
    const int steps = std::max(1, static_cast<int>(std::ceil(along.norm() / kPatch)));
    add_grid(&b->mesh, steps, 1, stone, [&](int column, int row) {
      const Eigen::Vector2d p2 = a + along * column / steps;
      const double z = grid.ground(p2.x(), p2.y()) + (row == 0 ? -0.05 : grid.kerb);
      return SurfacePoint{{p2.x(), p2.y(), z}, {along.norm() * column / steps, row * 0.15}};
    });
  }
}

constexpr double kOutside = 60.0;  // metres that streets and fields go on beyond the outermost blocks

double margin_after(const std::vector<double>& values, std::size_t i) {
  return i + 1 < values.size() ? values[i + 1] : values[i] + kOutside;
}

/// Stretches between streets, with one beyond each end.
std::vector<std::pair<double, double>> between(const std::vector<double>& lines,
                                               const std::vector<double>& half) {
  std::vector<std::pair<double, double>> gaps{{lines.front() - kOutside, lines.front() - half.front()}};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool last = i + 1 == lines.size();
    gaps.emplace_back(lines[i] + half[i], last ? lines[i] + kOutside : lines[i + 1] - half[i + 1]);
  }
  return gaps;
}

/// Grass all round the outermost streets.
void add_outer_fields(WorldBuilder* b, const CityGrid& g) {
  const MaterialId grass = b->mottled(0.4, 0.4, 1.5);
  const auto columns = between(g.xs, g.half_x), rows = between(g.ys, g.half_y);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    for (std::size_t j = 0; j < rows.size(); ++j) {
      const bool outer = i == 0 || j == 0 || i + 1 == columns.size() || j + 1 == rows.size();
      if (!outer) continue;
      add_rectangle(b, g, {columns[i].first, columns[i].second, rows[j].first, rows[j].second, false, 0.0},
                    0.05, grass);
    }
  }
}

std::vector<double> draw_lines(WorldBuilder* b, int blocks, int origin, double low, double high) {
  std::vector<double> lines{0.0};
  for (int i = 0; i < blocks; ++i) lines.push_back(lines.back() + b->random.uniform(low, high));
  const double shift = lines[static_cast<std::size_t>(origin)];
  for (double& line : lines) line -= shift;
  return lines;
}

}  // namespace

Ground make_rolling_ground(double amplitude, Random* random) {
  struct Wave {
    double x, y, phase, height;
  };
  std::vector<Wave> waves;
  for (int i = 0; i < 5; ++i) {
    const double length = random->uniform(60.0, 260.0);
    const double angle = random->uniform(0.0, 2.0 * M_PI);
    waves.push_back({2.0 * M_PI / length * std::cos(angle), 2.0 * M_PI / length * std::sin(angle),
                     random->uniform(0.0, 2.0 * M_PI),
                     amplitude * length / 160.0 * random->uniform(0.3, 0.6)});
  }
  return [waves](double x, double y) {
    double z = 0.0;
    for (const Wave& wave : waves) z += wave.height * std::sin(wave.x * x + wave.y * y + wave.phase);
    return z;
  };
}

CityGrid draw_city_grid(WorldBuilder* b, int columns, int rows, int origin_column, int origin_row) {
  CityGrid grid;
  grid.xs = draw_lines(b, columns, origin_column, 80.0, 125.0);
  grid.ys = draw_lines(b, rows, origin_row, 65.0, 100.0);
  for (std::size_t i = 0; i < grid.xs.size(); ++i) grid.half_x.push_back(b->random.uniform(5.0, 6.2));
  for (std::size_t j = 0; j < grid.ys.size(); ++j) grid.half_y.push_back(b->random.uniform(5.0, 6.2));
  grid.pavement = b->random.uniform(2.6, 4.0);
  grid.kerb = b->random.uniform(0.1, 0.15);
  grid.ground = make_rolling_ground(b->settings.rolling_m, &b->random);
  return grid;
}

void add_city_ground(WorldBuilder* b, const CityGrid& g) {
  add_outer_fields(b, g);
  for (std::size_t i = 0; i < g.xs.size(); ++i) {
    for (std::size_t j = 0; j < g.ys.size(); ++j) {
      const double x = g.xs[i], y = g.ys[j], hx = g.half_x[i], hy = g.half_y[j];
      const bool last_x = i + 1 == g.xs.size(), last_y = j + 1 == g.ys.size();
      const double next_x = margin_after(g.xs, i) - (last_x ? 0.0 : g.half_x[i + 1]);
      const double next_y = margin_after(g.ys, j) - (last_y ? 0.0 : g.half_y[j + 1]);
      const MaterialId open = b->mottled(0.22, 0.3, 4.0);
      add_rectangle(b, g, {x - hx, x + hx, y - hy, y + hy, true, x}, 0.0, open);
      add_road(b, g, x + hx, next_x, y, hy, false);
      add_road(b, g, y + hy, next_y, x, hx, true);
      if (i == 0) add_road(b, g, x - kOutside, x - hx, y, hy, false);
      if (j == 0) add_road(b, g, y - kOutside, y - hy, x, hx, true);
      if (!last_x && !last_y) add_block_ground(b, g, x + hx, next_x, y + hy, next_y);
    }
  }
}

}  // namespace fdi_lio::simulation
