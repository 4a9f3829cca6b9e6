#include "fdi_lio/scan/intensity_gradient.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {

constexpr int kMaxCandidates = 44;

/// Squared distance and difference of intensity of one neighbour.
struct Neighbour {
  float distance_sq;
  float difference;
};

/// Neighbours found in a window about one point.
class Window {
 public:
  Window(const DeskewedScan& scan, const std::vector<float>& levels, const RangeImage& image)
      : scan_(scan), levels_(levels), image_(image) {}

  /// Looks into `half_rings` rings above and below and `half_columns` steps of `stride` columns to each side.
  void collect(std::uint32_t i, int half_rings, int half_columns, int stride) {
    const Point& point = scan_.points[i];
    count_ = 0;
    const int first = std::max(0, point.ring - half_rings);
    const int last = std::min(image_.rings() - 1, point.ring + half_rings);
    for (int ring = first; ring <= last; ++ring) {
      for (int step = -half_columns; step <= half_columns; ++step) {
        const std::uint32_t j = image_.at(ring, point.column + step * stride);
        if (j == RangeImage::kNone || j == i) continue;
        neighbours_[count_++] = {(scan_.points[j].position - point.position).squaredNorm(),
                                 std::abs(levels_[j] - levels_[i])};
      }
    }
  }

  int within(float radius_sq) const {
    int count = 0;
    for (int k = 0; k < count_; ++k) count += neighbours_[k].distance_sq <= radius_sq ? 1 : 0;
    return count;
  }

  /// Mean difference of those within the radius; 0 without any.
  float mean_within(float radius_sq) const {
    float sum = 0.0F;
    int count = 0;
    for (int k = 0; k < count_; ++k) {
      if (neighbours_[k].distance_sq > radius_sq) continue;
      sum += neighbours_[k].difference;
      ++count;
    }
    return count > 0 ? sum / static_cast<float>(count) : 0.0F;
  }

  /// Mean difference of the `wanted` nearest.
  float mean_of_nearest(int wanted) {
    const int used = std::min(wanted, count_);
    if (used == 0) return 0.0F;
    if (used < count_) {
      std::nth_element(neighbours_.begin(), neighbours_.begin() + used, neighbours_.begin() + count_,
                       [](const Neighbour& a, const Neighbour& b) { return a.distance_sq < b.distance_sq; });
    }
    float sum = 0.0F;
    for (int k = 0; k < used; ++k) sum += neighbours_[k].difference;
    return sum / static_cast<float>(used);
  }

 private:
  const DeskewedScan& scan_;
  const std::vector<float>& levels_;
  const RangeImage& image_;
  std::array<Neighbour, kMaxCandidates> neighbours_;
  int count_ = 0;
};

}  // namespace

IntensityGradient::IntensityGradient(const GradientConfig& config) : config_(config) {}

std::vector<float> IntensityGradient::compute(const DeskewedScan& scan, const std::vector<float>& levels,
                                              const RangeImage& image) const {
  std::vector<float> gradients(scan.points.size(), 0.0F);
  const bool always_radius = config_.neighbourhood == "radius";
  const bool always_nearest = config_.neighbourhood == "knn";
  const auto fine_sq = static_cast<float>(config_.fine_radius_m * config_.fine_radius_m);
  const auto coarse_sq = static_cast<float>(config_.coarse_radius_m * config_.coarse_radius_m);
  const float column_rad = 2.0F * static_cast<float>(M_PI) / static_cast<float>(image.columns());
  const auto spacing = static_cast<float>(config_.sample_spacing_m);
  parallel_chunks(scan.ring_count(), 4, [&](std::size_t begin, std::size_t end, std::size_t) {
    Window window(scan, levels, image);
    for (std::uint32_t i = scan.ring_begin[begin]; i < scan.ring_begin[end]; ++i) {
      const float step_m = scan.points[i].position.norm() * column_rad;
      const int stride = std::clamp(static_cast<int>(spacing / step_m), 1, 16);
      window.collect(i, 1, 2, stride);
      const bool is_dense = window.within(fine_sq) >= config_.fine_neighbours;
      if (is_dense) {
        gradients[i] =
            always_nearest ? window.mean_of_nearest(config_.fine_neighbours) : window.mean_within(fine_sq);
        continue;
      }
      window.collect(i, 2, 4, stride);
      gradients[i] =
          always_radius ? window.mean_within(coarse_sq) : window.mean_of_nearest(config_.coarse_neighbours);
    }
  });
  return gradients;
}

}  // namespace fdi_lio::scan
