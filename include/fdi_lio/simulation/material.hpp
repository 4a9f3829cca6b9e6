#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace fdi_lio::simulation {

/// How the reflectivity of a surface varies over its texture coordinates (metres along and across the
/// surface).
enum class Texture : std::uint8_t {
  kPlain,     ///< the same everywhere
  kMottled,   ///< soft stains, `scale_m` wide
  kBricks,    ///< courses of bricks with mortar joints
  kPaving,    ///< square slabs of `scale_m` with joints
  kRoad,      ///< asphalt; u along, v across from the centre line; centre dashes, edge lines
  kCrossing,  ///< asphalt with a zebra crossing: stripes along u
  kHighway,   ///< asphalt with dashes between lanes of 3.6 m and edge lines; u along, v across
  kLining,    ///< tunnel lining: panels of `scale_m` along u, joints, soot, wet patches, paint marks
  kPlaster,   ///< wall paint with a dado line at v = 1.1 m and scuffs
  kTiles,     ///< floor tiles of `scale_m` in two tones
  kRock,      ///< strong variation at several scales, wet streaks
  kChecker,   ///< two tones in squares of `scale_m` (calibration targets, posters)
};

/// What a surface does to a laser pulse of about 900 nm.
struct Material {
  Texture texture = Texture::kPlain;
  float reflectivity = 0.3f;  ///< diffuse reflectivity, 0 to 1
  float contrast = 0.0f;      ///< relative variation of the texture, 0 to 1
  float scale_m = 1.0f;       ///< size of the texture's pattern
  float half_width_m = 4.0f;  ///< roads: from the centre line to the kerb
  float pass_share = 0.0f;    ///< share of pulses that go through (glass, mesh)
  float mirror_share = 0.0f;  ///< share of pulses that are lost by mirror reflection off the normal
  float retro_gain = 0.0f;    ///< retro-reflective: signal is this much stronger than a white diffuse surface
  std::uint32_t seed = 0;     ///< of the texture's randomness
};

/// Diffuse reflectivity in [0.005, 1] at texture coordinates `uv` (metres).
float reflectivity_at(const Material& material, const Eigen::Vector2f& uv);

}  // namespace fdi_lio::simulation
