#include "fdi_lio/scan/isolated_points.hpp"

#include <cmath>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {

constexpr int kColumnsAside = 2;

/// Counts neighbours until there are enough.
class NeighbourCounter {
 public:
  NeighbourCounter(const DeskewedScan& scan, const RangeImage& image, const IsolationConfig& config)
      : scan_(scan),
        image_(image),
        enough_(config.min_neighbours),
        reach_m_(static_cast<float>(config.reach_m)),
        reach_share_(static_cast<float>(config.reach_columns * 2.0 * M_PI / image.columns())) {}

  bool is_isolated(const Point& point) const {
    const float reach = reach_m_ + reach_share_ * image_.range_at(point.ring, point.column);
    int missing = enough_;
    for (const int ring : {point.ring + 0, point.ring - 1, point.ring + 1}) {
      if (ring < 0 || ring >= image_.rings()) continue;
      missing -= count(point, ring, reach * reach);
      if (missing <= 0) return false;
    }
    return true;
  }

 private:
  int count(const Point& point, int ring, float reach_sq) const {
    int found = 0;
    for (int column = point.column - kColumnsAside; column <= point.column + kColumnsAside; ++column) {
      const std::uint32_t other = image_.at(ring, column);
      if (other == RangeImage::kNone || (ring == point.ring && column == point.column)) continue;
      if ((scan_.points[other].position - point.position).squaredNorm() <= reach_sq) ++found;
    }
    return found;
  }

  const DeskewedScan& scan_;
  const RangeImage& image_;
  int enough_;
  float reach_m_;
  float reach_share_;
};

}  // namespace

std::vector<RemovalReason> find_isolated(const DeskewedScan& scan, const RangeImage& image,
                                         const IsolationConfig& config) {
  if (config.min_neighbours == 0 || image.empty()) return {};
  const NeighbourCounter counter(scan, image, config);
  std::vector<RemovalReason> reasons(scan.points.size(), RemovalReason::kNone);
  parallel_chunks(reasons.size(), 8192, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) {
      if (counter.is_isolated(scan.points[i])) reasons[i] = RemovalReason::kIsolated;
    }
  });
  return reasons;
}

}  // namespace fdi_lio::scan
