#include "fdi_lio/simulation/random.hpp"

namespace fdi_lio::simulation {

float smooth_noise(float u, float v, std::uint32_t seed) {
  const float floor_u = std::floor(u);
  const float floor_v = std::floor(v);
  const auto i = static_cast<std::int32_t>(floor_u);
  const auto j = static_cast<std::int32_t>(floor_v);
  const float a = u - floor_u;
  const float b = v - floor_v;
  const float s = a * a * (3.0f - 2.0f * a);
  const float t = b * b * (3.0f - 2.0f * b);
  const float low = cell_noise(i, j, seed) * (1.0f - s) + cell_noise(i + 1, j, seed) * s;
  const float high = cell_noise(i, j + 1, seed) * (1.0f - s) + cell_noise(i + 1, j + 1, seed) * s;
  return low * (1.0f - t) + high * t;
}

float fractal_noise(float u, float v, int octaves, std::uint32_t seed) {
  float sum = 0.0f;
  float total = 0.0f;
  float weight = 1.0f;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += weight * smooth_noise(u, v, seed + static_cast<std::uint32_t>(octave));
    total += weight;
    weight *= 0.5f;
    u *= 2.0f;
    v *= 2.0f;
  }
  return sum / total;
}

}  // namespace fdi_lio::simulation
