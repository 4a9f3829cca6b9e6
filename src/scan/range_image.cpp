#include "fdi_lio/scan/range_image.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/wide_vectors.hpp"

namespace fdi_lio::scan {

namespace {

constexpr auto kPi = static_cast<float>(M_PI);
constexpr int kMinColumns = 180;
constexpr int kMaxColumns = 4096;
constexpr double kColumnTolerance = 0.15;
constexpr std::size_t kSpacingStride = 37;
constexpr int kOriginRounds = 2;
/// Of the nine about a direction, and of the three on one ring, that must hold a range to say what lies
/// there.
constexpr int kLeastCells = 4;
constexpr int kLeastCellsOfRing = 2;

/// Without branches, so that the compiler computes several at a time.
inline float branchless_atan2(float y, float x) {
  const float ax = std::abs(x);
  const float ay = std::abs(y);
  const float larger = std::max(std::max(ax, ay), std::numeric_limits<float>::min());
  const float t = std::min(ax, ay) / larger;
  // Least-squares fit of atan(t) / t in t^2 on [0, 1].
  const float s = t * t;
  const float octant =
      (((((-0.0122997F * s + 0.0540827F) * s - 0.1176952F) * s + 0.1940199F) * s - 0.3326944F) * s +
       0.9999801F) *
      t;
  const float quadrant = std::abs((ay > ax ? 0.5F * kPi : 0.0F) - octant);
  return std::copysign(std::abs((x < 0.0F ? kPi : 0.0F) - quadrant), y);
}

inline int column_of(float x, float y, int columns) {
  const float turns = (kPi - branchless_atan2(y, x)) * (0.5F / kPi);
  return std::min(static_cast<int>(turns * static_cast<float>(columns)), columns - 1);
}

/// Bin of RangeImage's table of elevations.
inline int elevation_bin(float sine, int bins) {
  return std::min(std::max(static_cast<int>((sine + 1.0F) * 0.5F * static_cast<float>(bins)), 0), bins - 1);
}

/// How long ago a point was seen, as a share of the sweep.
float ago(const DeskewedScan& scan, const Point& point) {
  return scan.duration_s > 0.0 ? std::clamp(-point.time_s / static_cast<float>(scan.duration_s), 0.0F, 1.0F)
                               : 0.0F;
}

/// A point as seen from where the lidar was then.
Eigen::Vector3f from_origin(const DeskewedScan& scan, const Point& point) {
  return point.position - scan.sweep.origin(ago(scan, point));
}

/// The sine of the angle between a beam and the plane at right angles to the lidar's axis.
float sine_of_beam(const DeskewedScan& scan, const Point& point) {
  const Eigen::Vector3f direction = from_origin(scan, point);
  return scan.sweep.axis(ago(scan, point)).dot(direction) / direction.norm();
}

}  // namespace

float fast_atan2(float y, float x) { return branchless_atan2(y, x); }

void RangeImage::choose_columns(const DeskewedScan& scan) {
  std::vector<float> steps;
  for (std::size_t i = 0; i + 1 < scan.points.size(); i += kSpacingStride) {
    const Point& a = scan.points[i];
    const Point& b = scan.points[i + 1];
    if (a.ring != b.ring) continue;
    const auto p = a.position.head<2>();
    const auto q = b.position.head<2>();
    const float step = std::abs(fast_atan2(p.x() * q.y() - p.y() * q.x(), p.dot(q)));
    if (step > 0.0F) steps.push_back(step);
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
  sine_of_ring_.assign(static_cast<std::size_t>(rings_), 0.0F);
  for (int ring = 0; ring < rings_; ++ring) {
    double sum = 0.0;
    std::uint32_t count = 0;
    for (std::uint32_t i = scan.ring_begin[ring]; i < scan.ring_begin[ring + 1]; i += 5) {
      sum += sine_of_beam(scan, scan.points[i]);
      ++count;
    }
    if (count == 0) continue;
    sine_of_ring_[static_cast<std::size_t>(ring)] = static_cast<float>(sum / count);
    beams.push_back({sine_of_ring_[static_cast<std::size_t>(ring)], ring});
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
    const int first = elevation_bin(beams[k].sine - std::min(0.5F * gap_below, kFarthest), kElevationBins);
    const int last = elevation_bin(beams[k].sine + std::min(0.5F * gap_above, kFarthest), kElevationBins);
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
    Directions block;
    for (std::size_t ring = begin; ring < end; ++ring) {
      const std::uint32_t last = scan->ring_begin[ring + 1];
      for (std::uint32_t first = scan->ring_begin[ring]; first < last; first += Directions::kSize) {
        const int size = static_cast<int>(std::min<std::uint32_t>(Directions::kSize, last - first));
        for (int k = 0; k < size; ++k)
          block.set(k, from_origin(*scan, scan->points[first + static_cast<std::uint32_t>(k)]));
        project(&block);
        for (int k = 0; k < size; ++k) {
          const std::uint32_t i = first + static_cast<std::uint32_t>(k);
          scan->points[i].column = static_cast<std::uint16_t>(block.column[k]);
          const std::size_t at = cell(static_cast<int>(ring), block.column[k]);
          if (index_[at] != kNone && range_[at] <= block.range_m[k]) continue;
          index_[at] = i;
          range_[at] = block.range_m[k];
        }
      }
    }
  });
  learn_elevations(*scan);
  learn_motion(*scan);
}

void RangeImage::remove(const std::vector<RemovalReason>& reasons) {
  std::vector<std::uint32_t> number(reasons.size(), kNone);
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    if (reasons[i] == RemovalReason::kNone) number[i] = next++;
  }
  for (std::size_t at = 0; at < index_.size(); ++at) {
    if (index_[at] == kNone) continue;
    index_[at] = number[index_[at]];
    if (index_[at] == kNone) range_[at] = 0.0F;
  }
}

void RangeImage::learn_motion(const DeskewedScan& scan) {
  sweep_start_ = scan.sweep.start;
  seen_ago_.assign(static_cast<std::size_t>(columns_), -1.0F);
  for (const Point& point : scan.points) seen_ago_[point.column] = ago(scan, point);
  // Columns without a point are as old as the one before; two rounds, since it may be at the other end.
  float last = 0.0F;
  for (int round = 0; round < 2; ++round) {
    for (float& each : seen_ago_) {
      if (each >= 0.0F) last = each;
      if (each < 0.0F && round == 1) each = last;
    }
  }
  constexpr float kNegligible = 1e-3F;  // rad
  turns_ = std::any_of(scan.sweep.axes.begin(), scan.sweep.axes.end(),
                       [](const Eigen::Vector3f& axis) { return axis.head<2>().norm() > kNegligible; });
  if (!turns_) return;
  axis_x_.resize(seen_ago_.size());
  axis_y_.resize(seen_ago_.size());
  axis_z_.resize(seen_ago_.size());
  for (std::size_t column = 0; column < seen_ago_.size(); ++column) {
    const Eigen::Vector3f axis = scan.sweep.axis(seen_ago_[column]);
    axis_x_[column] = axis.x();
    axis_y_[column] = axis.y();
    axis_z_[column] = axis.z();
  }
}

FDI_LIO_WIDE_VECTORS void RangeImage::move_to_origins(Directions* directions) const {
  constexpr float kNegligible_m = 0.02F;
  if (sweep_start_.squaredNorm() < kNegligible_m * kNegligible_m) return;
  Directions& d = *directions;
  const Directions::Floats x = d.x;
  const Directions::Floats y = d.y;
  const Directions::Floats z = d.z;
  const float* seen_ago = seen_ago_.data();
  const float sweep_x = sweep_start_.x();
  const float sweep_y = sweep_start_.y();
  const float sweep_z = sweep_start_.z();
  // The origin tells the column, which tells the origin.
  for (int round = 0; round < kOriginRounds; ++round) {
    project(directions);
    for (int k = 0; k < Directions::kSize; ++k) {
      const float ago = seen_ago[d.column[k]];
      d.x[k] = x[k] - ago * sweep_x;
      d.y[k] = y[k] - ago * sweep_y;
      d.z[k] = z[k] - ago * sweep_z;
    }
  }
}

bool RangeImage::saw_farther(int first_ring, int last_ring, int column, float range_m,
                             int least_cells) const {
  int filled = 0;
  for (int r = std::max(0, first_ring); r <= std::min(rings_ - 1, last_ring); ++r) {
    for (int c = column - 1; c <= column + 1; ++c) {
      const float range = range_at(r, c);
      if (range <= 0.0F) continue;
      if (range <= range_m) return false;
      ++filled;
    }
  }
  return filled >= least_cells;
}

bool RangeImage::saw_farther(int ring, int column, float range_m) const {
  return saw_farther(ring - 1, ring + 1, column, range_m, kLeastCells);
}

bool RangeImage::ring_saw_farther(int ring, int column, float range_m) const {
  return saw_farther(ring, ring, column, range_m, kLeastCellsOfRing);
}

Eigen::Vector3f RangeImage::beam_towards(int ring, int column, const Eigen::Vector3f& point) const {
  const auto k = static_cast<std::size_t>(column);
  const Eigen::Vector3f axis =
      turns_ ? Eigen::Vector3f(axis_x_[k], axis_y_[k], axis_z_[k]) : Eigen::Vector3f::UnitZ();
  const Eigen::Vector3f level = point - axis.dot(point) * axis;
  const float sine = sine_of_ring_[static_cast<std::size_t>(ring)];
  return sine * axis + std::sqrt(std::max(0.0F, 1.0F - sine * sine)) * level.normalized();
}

FDI_LIO_WIDE_VECTORS void RangeImage::project(Directions* directions) const {
  Directions& d = *directions;
  for (int k = 0; k < Directions::kSize; ++k)
    d.range_m[k] = std::sqrt(d.x[k] * d.x[k] + d.y[k] * d.y[k] + d.z[k] * d.z[k]);
  const int columns = columns_;
  for (int k = 0; k < Directions::kSize; ++k) d.column[k] = column_of(d.x[k], d.y[k], columns);
}

FDI_LIO_WIDE_VECTORS void RangeImage::look_at(const Eigen::Isometry3f& T, Directions* directions) const {
  Directions& d = *directions;
  const Eigen::Matrix3f R = T.linear();
  const Eigen::Vector3f t = T.translation();
  for (int k = 0; k < Directions::kSize; ++k) {
    const float x = d.x[k];
    const float y = d.y[k];
    const float z = d.z[k];
    d.x[k] = R(0, 0) * x + R(0, 1) * y + R(0, 2) * z + t.x();
    d.y[k] = R(1, 0) * x + R(1, 1) * y + R(1, 2) * z + t.y();
    d.z[k] = R(2, 0) * x + R(2, 1) * y + R(2, 2) * z + t.z();
  }
  move_to_origins(directions);
  project(directions);
  Directions::Floats height = d.z;  // over the plane at right angles to the lidar's axis
  if (turns_) {
    const float* axis_x = axis_x_.data();
    const float* axis_y = axis_y_.data();
    const float* axis_z = axis_z_.data();
    for (int k = 0; k < Directions::kSize; ++k) {
      const std::int32_t column = d.column[k];
      height[k] = axis_x[column] * d.x[k] + axis_y[column] * d.y[k] + axis_z[column] * d.z[k];
    }
  }
  for (int k = 0; k < Directions::kSize; ++k) {
    const float sine = height[k] / std::max(d.range_m[k], std::numeric_limits<float>::min());
    d.ring[k] = elevation_bin(sine, kElevationBins);
  }
  for (int k = 0; k < Directions::kSize; ++k)
    d.ring[k] = columns_ > 0 && d.range_m[k] > 0.0F ? ring_of_sine_[d.ring[k]] : -1;
  // Whoever looks asks for the range next; most of the image is in no cache by then.
  for (int k = 0; k < Directions::kSize; ++k) {
    if (d.ring[k] >= 0) __builtin_prefetch(&range_[cell(d.ring[k], d.column[k])]);
  }
}

RangeImage::Direction RangeImage::look_at(const Eigen::Vector3f& point) const {
  Directions one;
  one.set(0, point);
  look_at(Eigen::Isometry3f::Identity(), &one);
  return {one.ring[0], one.column[0], one.range_m[0], one.ring[0] >= 0};
}

}  // namespace fdi_lio::scan
