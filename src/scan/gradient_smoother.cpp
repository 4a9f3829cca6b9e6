#include "fdi_lio/scan/gradient_smoother.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {
constexpr std::size_t kChunk = 8192;
/// A predicted cell shows the same surface when its range agrees within this.
constexpr float kSameSurface_m = 0.3F;
constexpr float kSameSurfaceShare = 0.02F;
}  // namespace

std::vector<float> GradientSmoother::update(const DeskewedScan& scan, const RangeImage& image,
                                            const std::optional<Eigen::Isometry3d>& T_previous_lidar,
                                            std::vector<float>* gradients) {
  const std::size_t count = scan.points.size();
  const auto Q = static_cast<float>(config_.process_noise);
  const auto R = static_cast<float>(config_.measurement_noise);
  State now;
  now.mean = *gradients;
  now.variance.assign(count, R);
  std::vector<float> stability(count, 0.0F);
  if (previous_ && T_previous_lidar) {
    const Eigen::Isometry3f T = T_previous_lidar->cast<float>();
    parallel_chunks(count, kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
      RangeImage::Directions seen;
      for (std::size_t first = begin; first < end; first += RangeImage::Directions::kSize) {
        const int size = static_cast<int>(std::min<std::size_t>(RangeImage::Directions::kSize, end - first));
        for (int k = 0; k < size; ++k) seen.set(k, scan.points[first + static_cast<std::size_t>(k)].position);
        previous_->image.look_at(T, &seen);
        for (int k = 0; k < size; ++k) {
          if (seen.ring[k] < 0) continue;
          const std::uint32_t j = previous_->image.at(seen.ring[k], seen.column[k]);
          if (j == RangeImage::kNone) continue;
          const float jump =
              std::abs(previous_->image.range_at(seen.ring[k], seen.column[k]) - seen.range_m[k]);
          if (jump > kSameSurface_m + kSameSurfaceShare * seen.range_m[k]) continue;
          const std::size_t i = first + static_cast<std::size_t>(k);
          const float predicted = previous_->mean[j];
          const float P = previous_->variance[j] + Q;
          const float innovation = (*gradients)[i] - predicted;
          const float gain = P / (P + R);
          now.mean[i] = predicted + gain * innovation;
          now.variance[i] = (1.0F - gain) * P;
          stability[i] = std::exp(-std::abs(innovation) / std::sqrt(P + R));
        }
      }
    });
  }
  *gradients = now.mean;
  now.image = image;
  previous_ = std::move(now);
  return stability;
}

}  // namespace fdi_lio::scan
