#pragma once

#include <cmath>
#include <cstdint>

namespace fdi_lio::simulation {

/// A bijection of 64-bit numbers that looks random: neighbouring inputs give unrelated outputs.
inline std::uint64_t scramble(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// A stream of random numbers that depends on its three keys only. Parallel work makes one stream for each
/// piece of work (seed, purpose, index) and shares none, so results do not depend on the number of threads.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t purpose = 0, std::uint64_t index = 0)
      : state_(scramble(scramble(scramble(seed) ^ purpose) ^ index)) {}

  std::uint64_t next() { return scramble(state_++); }

  /// Uniform in [0, 1).
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }

  /// Uniform in [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Uniform in {0, ..., count - 1}; count > 0.
  int index(int count) { return static_cast<int>(next() % static_cast<std::uint64_t>(count)); }

  /// True with the given probability.
  bool chance(double probability) { return uniform() < probability; }

  /// Standard normal (Box-Muller; the second number is kept for the next call).
  double normal() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    const double angle = 2.0 * M_PI * uniform();
    spare_ = radius * std::sin(angle);
    has_spare_ = true;
    return radius * std::cos(angle);
  }

  /// About standard normal, never beyond 3.5: a sum of four uniform numbers out of one draw. Several times
  /// faster.
  double rough_normal() {
    const std::uint64_t bits = next();
    const double sum =
        static_cast<double>((bits & 0xffff) + (bits >> 16 & 0xffff) + (bits >> 32 & 0xffff) + (bits >> 48));
    return (sum - 2.0 * 65535.0) * (1.7320508075688772 / 65536.0);
  }

 private:
  std::uint64_t state_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

/// Uniform in [0, 1) for a cell of an integer grid; the same cell always gives the same number.
inline float cell_noise(std::int32_t i, std::int32_t j, std::uint32_t seed) {
  const std::uint64_t key =
      (static_cast<std::uint64_t>(static_cast<std::uint32_t>(i)) << 32) | static_cast<std::uint32_t>(j);
  return static_cast<float>(scramble(key ^ (static_cast<std::uint64_t>(seed) << 17)) >> 40) * 0x1.0p-24f;
}

/// Value noise in [0, 1]: smooth between the cells of a unit grid.
float smooth_noise(float u, float v, std::uint32_t seed);

/// Sum of `octaves` smooth noises, each half as wide and half as strong; in [0, 1].
float fractal_noise(float u, float v, int octaves, std::uint32_t seed);

}  // namespace fdi_lio::simulation
