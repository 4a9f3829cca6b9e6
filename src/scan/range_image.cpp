#include "fdi_lio/scan/range_image.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {

constexpr auto kPi = static_cast<float>(M_PI);
constexpr int kMinColumns = 180;
constexpr int kMaxColumns = 4096;
constexpr double kColumnTolerance = 0.15;
constexpr std::size_t kSpacingStride = 7;

}  // namespace

float fast_atan2(float y, float x) {
  const float ax = std::abs(x);
  const float ay = std::abs(y);
  const float larger = std::max(ax, ay);
  if (larger == 0.0F) return 0.0F;
  const float t = std::min(ax, ay) / larger;
  // Least-squares fit of atan(t) / t in t^2 on [0, 1].
  const float s = t * t;
  float angle = (((((-0.0122997F * s + 0.0540827F) * s - 0.1176952F) * s + 0.1940199F) * s - 0.3326944F) * s +
                 0.9999801F) *
                t;
  if (ay > ax) angle = 0.5F * kPi - angle;
  if (x < 0.0F) angle = kPi - angle;
  return y < 0.0F ? -angle : angle;
}

int RangeImage::column_of(const Eigen::Vector3f& point) const {
  const float turns = (kPi - fast_atan2(point.y(), point.x())) / (2.0F * kPi);
  return std::min(static_cast<int>(turns * static_cast<float>(columns_)), columns_ - 1);
}

void RangeImage::choose_columns(const DeskewedScan& scan) {
  std::vector<float> steps;
  for (std::size_t i = 0; i + 1 < scan.points.size(); i += kSpacingStride) {
    const Point& a = scan.points[i];
    const Point& b = scan.points[i + 1];
    if (a.ring != b.ring) continue;
    const float step =
        std::abs(fast_atan2(a.position.y(), a.position.x()) - fast_atan2(b.position.y(), b.position.x()));
    if (step > 0.0F && step < kPi) steps.push_back(step);
  }
  int wanted = columns_ > 0 ? columns_ : kMinColumns;
  if (!steps.empty()) {
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    wanted = std::clamp(static_cast<int>(std::lround(2.0F * kPi / *middle)), kMinColumns, kMaxColumns);
  }
  if (columns_ == 0 || std::abs(wanted - columns_) > kColumnTolerance * columns_) columns_ = wanted;
}

void RangeImage::learn_elevations(const DeskewedScan& scan) {
  struct Beam {
    float sine;
    int ring;
  };
  std::vector<Beam> beams;
  for (int ring = 0; ring < rings_; ++ring) {
    double sum = 0.0;
    std::uint32_t count = 0;
    for (std::uint32_t i = scan.ring_begin[ring]; i < scan.ring_begin[ring + 1]; i += 5) {
      sum += scan.points[i].position.z() / scan.points[i].position.norm();
      ++count;
    }
    if (count > 0) beams.push_back({static_cast<float>(sum / count), ring});
  }
  std::sort(beams.begin(), beams.end(), [](const Beam& a, const Beam& b) { return a.sine < b.sine; });
  ring_of_sine_.fill(-1);
  for (std::size_t k = 0; k < beams.size(); ++k) {
    const float below = k > 0 ? beams[k].sine - beams[k - 1].sine : 0.0F;
    const float above = k + 1 < beams.size() ? beams[k + 1].sine - beams[k].sine : 0.0F;
    const float gap_below = below > 0.0F ? below : above;
    const float gap_above = above > 0.0F ? above : below;
    // Half the gap belongs to each of two neighbours, but a beam never sees farther than one degree.
    constexpr float kFarthest = 0.0175F;
    const auto bin = [](float sine) {
      return std::clamp(static_cast<int>((sine + 1.0F) * 0.5F * kElevationBins), 0, kElevationBins - 1);
    };
    const int first = bin(beams[k].sine - std::min(0.5F * gap_below, kFarthest));
    const int last = bin(beams[k].sine + std::min(0.5F * gap_above, kFarthest));
    for (int b = first; b <= last; ++b) ring_of_sine_[b] = static_cast<std::int16_t>(beams[k].ring);
  }
}

void RangeImage::build(DeskewedScan* scan) {
  rings_ = static_cast<int>(scan->ring_count());
  choose_columns(*scan);
  const std::size_t cells = static_cast<std::size_t>(rings_) * static_cast<std::size_t>(columns_);
  index_.assign(cells, kNone);
  range_.assign(cells, 0.0F);
  parallel_chunks(static_cast<std::size_t>(rings_), 8, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t ring = begin; ring < end; ++ring) {
      for (std::uint32_t i = scan->ring_begin[ring]; i < scan->ring_begin[ring + 1]; ++i) {
        Point& point = scan->points[i];
        const int column = column_of(point.position);
        point.column = static_cast<std::uint16_t>(column);
        const std::size_t at = cell(static_cast<int>(ring), column);
        const float range = point.position.norm();
        if (index_[at] != kNone && range_[at] <= range) continue;
        index_[at] = i;
        range_[at] = range;
      }
    }
  });
  learn_elevations(*scan);
}

RangeImage::Direction RangeImage::look_at(const Eigen::Vector3f& point) const {
  Direction direction;
  direction.range_m = point.norm();
  if (columns_ == 0 || direction.range_m <= 0.0F) return direction;
  const float sine = point.z() / direction.range_m;
  const int bin = std::clamp(static_cast<int>((sine + 1.0F) * 0.5F * kElevationBins), 0, kElevationBins - 1);
  if (ring_of_sine_[bin] < 0) return direction;
  direction.ring = ring_of_sine_[bin];
  direction.column = column_of(point);
  direction.is_inside = true;
  return direction;
}

}  // namespace fdi_lio::scan
