#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

/// FDI_LIO_WIDE_VECTORS before a function compiles it twice, for any x86-64 and for processors with AVX2
/// (eight floats at a time), and the loader picks. Both give the same bits, since the build forbids fused
/// multiply-adds. Only what is inlined into the function is compiled with it: no lambda that is handed on,
/// and Eigen's expressions stay at four floats. Elsewhere, and under sanitizers, which are not up yet when
/// the loader picks, it does nothing.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define FDI_LIO_WIDE_VECTORS __attribute__((target_clones("avx2", "default")))
#else
#define FDI_LIO_WIDE_VECTORS
#endif

/// Before a function that has to be inlined into one with FDI_LIO_WIDE_VECTORS.
#define FDI_LIO_INLINE __attribute__((always_inline)) inline

namespace fdi_lio {

constexpr int kWideLanes = 8;
/// Of members that are wide vectors: what AVX2 expects, and the compiler does not see to without it.
constexpr std::size_t kWideAlignment = kWideLanes * sizeof(float);
/// Eight numbers in one or two registers; comparisons give all ones or zeros. Written with arrays, the
/// compiler makes such masks one by one, and reading them back several at a time stalls.
using WideFloats = float __attribute__((vector_size(kWideLanes * sizeof(float))));
using WideIntegers = std::int32_t __attribute__((vector_size(kWideLanes * sizeof(std::int32_t))));

FDI_LIO_INLINE void load(const float* from, WideFloats* lanes) { std::memcpy(lanes, from, sizeof(*lanes)); }

/// Whether a lane of the mask is set.
FDI_LIO_INLINE bool any(const WideIntegers& mask) {
  std::array<std::uint64_t, sizeof(mask) / sizeof(std::uint64_t)> parts;
  std::memcpy(parts.data(), &mask, sizeof(mask));
  return (parts[0] | parts[1] | parts[2] | parts[3]) != 0;
}

}  // namespace fdi_lio
