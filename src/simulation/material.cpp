#include "fdi_lio/simulation/material.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/simulation/random.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr float kPaintReflectivity = 0.75f;

/// Position within a repeating cell, in [0, period).
float wrap(float x, float period) { return x - period * std::floor(x / period); }

int cell(float x, float period) { return static_cast<int>(std::floor(x / period)); }

float mottled(const Material& m, float u, float v) {
  const float noise = fractal_noise(u / m.scale_m, v / m.scale_m, 2, m.seed);
  return m.reflectivity * (1.0f + m.contrast * (2.0f * noise - 1.0f));
}

float bricks(const Material& m, float u, float v) {
  constexpr float kCourse = 0.25f;
  constexpr float kLength = 0.5f;
  constexpr float kJoint = 0.02f;
  const int row = cell(v, kCourse);
  const float shifted = u + (row % 2 == 0 ? 0.0f : 0.5f * kLength);
  if (wrap(v, kCourse) < kJoint || wrap(shifted, kLength) < kJoint) return 0.45f;
  const float tone = 2.0f * cell_noise(row, cell(shifted, kLength), m.seed) - 1.0f;
  return m.reflectivity * (1.0f + m.contrast * tone);
}

/// Slabs of one batch differ little; dirt and wear pass over several of them, and one in 30 was replaced.
float slabs(const Material& m, float u, float v) {
  constexpr float kJoint = 0.015f;
  constexpr float kStainM = 2.5f;
  const int i = cell(u, m.scale_m), j = cell(v, m.scale_m);
  const float own = 2.0f * cell_noise(i, j, m.seed) - 1.0f;
  const float stain = 2.0f * fractal_noise(u / kStainM, v / kStainM, 3, m.seed + 1) - 1.0f;
  const bool replaced = cell_noise(i, j, m.seed + 2) > 0.967f;
  const float tone = replaced ? own : 0.25f * own + 0.75f * stain;
  const bool joint = wrap(u, m.scale_m) < kJoint || wrap(v, m.scale_m) < kJoint;
  return (joint ? 0.5f : 1.0f) * m.reflectivity * (1.0f + m.contrast * tone);
}

/// Paint wears off in patches.
float worn_paint(const Material& m, float u, float v) {
  const float wear = smooth_noise(3.0f * u, 3.0f * v, m.seed + 17);
  return wear > 0.85f ? m.reflectivity : kPaintReflectivity * (0.75f + 0.25f * wear);
}

float asphalt(const Material& m, float u, float v) {
  const float patch = fractal_noise(u / 6.0f, v / 1.5f, 3, m.seed);
  const bool repaired = smooth_noise(u / 9.0f, v / 3.0f, m.seed + 5) > 0.78f;
  return m.reflectivity * (repaired ? 0.6f : 1.0f) * (1.0f + m.contrast * (2.0f * patch - 1.0f));
}

float road(const Material& m, float u, float v) {
  const bool dash = std::abs(v) < 0.075f && wrap(u, 9.0f) < 3.0f;
  const float from_edge = m.half_width_m - std::abs(v);
  const bool edge_line = from_edge > 2.25f && from_edge < 2.37f && wrap(u, 6.0f) < 5.0f;
  return dash || edge_line ? worn_paint(m, u, v) : asphalt(m, u, v);
}

float crossing(const Material& m, float u, float v) {
  const bool inside = std::abs(v) < m.half_width_m - 0.4f;
  const bool stripe = wrap(v, 1.0f) < 0.5f;
  return inside && stripe ? worn_paint(m, u, v) : asphalt(m, u, v);
}

/// v is 0 at the line beside the median; three lanes, then the hard shoulder.
float highway(const Material& m, float u, float v) {
  constexpr float kLane = 3.6f;
  const float line = std::round(v / kLane);
  const float from_line = std::abs(v - kLane * line);
  const bool solid = (line == 0.0f || line == 3.0f) && from_line < 0.12f;
  const bool dash = line > 0.0f && line < 3.0f && from_line < 0.075f && wrap(u, 18.0f) < 6.0f;
  return solid || dash ? worn_paint(m, u, v) : asphalt(m, u, v);
}

/// Marks that real tunnels carry for maintenance and escape: numbers, arrows, stripes; one here and there.
bool paint_mark(const Material& m, float u, float v) {
  constexpr float kSpacing = 12.5f;
  const int i = cell(u, kSpacing);
  if (cell_noise(i, 1, m.seed + 3) > 0.65f) return false;
  const float start = kSpacing * (0.1f + 0.6f * cell_noise(i, 2, m.seed + 3));
  const float width = 0.3f + 1.2f * cell_noise(i, 3, m.seed + 3);
  const float bottom = 0.9f + 1.2f * cell_noise(i, 4, m.seed + 3);
  const float x = wrap(u, kSpacing) - start;
  return x > 0.0f && x < width && v > bottom && v < bottom + 0.5f;
}

float lining(const Material& m, float u, float v) {
  if (paint_mark(m, u, v)) return kPaintReflectivity;
  if (wrap(u, m.scale_m) < 0.03f) return 0.35f * m.reflectivity;
  const float soot = 0.85f + 0.3f * smooth_noise(u / 15.0f, v / 2.0f, m.seed + 1);
  const float wet = smooth_noise(u / 4.0f, v / 9.0f, m.seed + 2);
  const float tone = 1.0f + m.contrast * (2.0f * cell_noise(cell(u, m.scale_m), 0, m.seed) - 1.0f);
  return m.reflectivity * soot * tone * (wet > 0.82f ? 0.4f : 1.0f);
}

float plaster(const Material& m, float u, float v) {
  const float scuff = smooth_noise(1.5f * u, 4.0f * v, m.seed);
  const float dado = v < 1.1f ? 0.75f : 1.0f;
  return m.reflectivity * dado * (1.0f - m.contrast * (scuff > 0.8f ? 1.0f : 0.2f * scuff));
}

float rock(const Material& m, float u, float v) {
  const float coarse = fractal_noise(u / 3.0f, v / 3.0f, 4, m.seed);
  const float wet = smooth_noise(u / 1.5f, v / 6.0f, m.seed + 9);
  return m.reflectivity * (1.0f + m.contrast * (2.0f * coarse - 1.0f)) * (wet > 0.75f ? 0.45f : 1.0f);
}

float checker(const Material& m, float u, float v) {
  const bool dark = (cell(u, m.scale_m) + cell(v, m.scale_m)) % 2 != 0;
  return m.reflectivity * (dark ? 1.0f - m.contrast : 1.0f);
}

float textured(const Material& m, float u, float v) {
  switch (m.texture) {
    case Texture::kPlain:
      return m.reflectivity;
    case Texture::kMottled:
      return mottled(m, u, v);
    case Texture::kBricks:
      return bricks(m, u, v);
    case Texture::kPaving:
      return slabs(m, u, v);
    case Texture::kRoad:
      return road(m, u, v);
    case Texture::kCrossing:
      return crossing(m, u, v);
    case Texture::kHighway:
      return highway(m, u, v);
    case Texture::kLining:
      return lining(m, u, v);
    case Texture::kPlaster:
      return plaster(m, u, v);
    case Texture::kTiles:
      return slabs(m, u, v);
    case Texture::kRock:
      return rock(m, u, v);
    case Texture::kChecker:
      return checker(m, u, v);
  }
  return m.reflectivity;
}

}  // namespace

float reflectivity_at(const Material& material, const Eigen::Vector2f& uv) {
  return std::clamp(textured(material, uv.x(), uv.y()), 0.005f, 1.0f);
}

}  // namespace fdi_lio::simulation
