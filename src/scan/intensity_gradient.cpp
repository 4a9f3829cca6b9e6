#include "fdi_lio/scan/intensity_gradient.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "fdi_lio/common/parallel.hpp"
#include "fdi_lio/common/wide_vectors.hpp"

namespace fdi_lio::scan {

namespace {

using Floats = WideFloats;
using Mask = WideIntegers;

constexpr int kMaxStride = 16;
constexpr int kFineRings = 1;  ///< looked at above and below
constexpr int kFineSteps = 2;  ///< looked at to each side
constexpr int kCoarseRings = 2;
constexpr int kCoarseSteps = 4;

/// Empty cells lie so far away [m] that no radius reaches them; squares of it are still finite.
constexpr float kNowhere_m = 1e15F;
constexpr float kAnywhereSq = 1e12F;

/// Position, level and stride of the point in each cell of a range image, one plane of floats each;
/// (kNowhere_m, 0, 0, 0, 0) in empty ones. A border of two empty rings, and of columns from the other side,
/// makes checks in the windows needless.
class CellImage {
 public:
  enum Plane { kX, kY, kZ, kLevel, kStride, kPlanes };

  /// The cells are kept in `memory`, which is used again by the next scan. A stride is that distance in
  /// columns which is `spacing` / range, in [1, kMaxStride].
  CellImage(const DeskewedScan& scan, const std::vector<float>& levels, const RangeImage& image,
            float spacing, std::vector<float>* memory)
      : columns_(image.columns()),
        width_(columns_ + 2 * kBorder),
        plane_(static_cast<std::size_t>(image.rings() + 2 * kCoarseRings) * static_cast<std::size_t>(width_)),
        cells_(*memory) {
    cells_.assign(kPlanes * plane_, 0.0F);
    std::fill_n(cells_.begin(), plane_, kNowhere_m);
    parallel_chunks(static_cast<std::size_t>(image.rings()), 8,
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      for (std::size_t ring = begin; ring < end; ++ring)
                        fill(scan, levels, image, spacing, static_cast<int>(ring));
                    });
  }

  int columns() const { return columns_; }
  std::ptrdiff_t width() const { return width_; }

  /// A cell, and those right of it, in a plane.
  FDI_LIO_INLINE const float* at(Plane plane, int ring, int column) const {
    return &cells_[plane * plane_ + index(ring, column)];
  }
  /// From one plane to the next.
  std::ptrdiff_t plane_size() const { return static_cast<std::ptrdiff_t>(plane_); }

 private:
  static constexpr int kBorder = kCoarseSteps * kMaxStride + kWideLanes;

  FDI_LIO_INLINE std::size_t index(int ring, int column) const {
    return static_cast<std::size_t>(ring + kCoarseRings) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column + kBorder);
  }

  void fill(const DeskewedScan& scan, const std::vector<float>& levels, const RangeImage& image,
            float spacing, int ring) {
    float* row = &cells_[index(ring, 0)];
    for (int column = 0; column < columns_; ++column) {
      const std::uint32_t i = image.at(ring, column);
      if (i == RangeImage::kNone) continue;
      const Eigen::Vector3f& p = scan.points[i].position;
      float* cell = row + column;
      for (int axis = 0; axis < 3; ++axis) cell[static_cast<std::size_t>(axis) * plane_] = p[axis];
      cell[kLevel * plane_] = levels[i];
      const int stride = static_cast<int>(spacing / image.range_at(ring, column));
      cell[kStride * plane_] = static_cast<float>(std::clamp(stride, 1, kMaxStride));
    }
    for (int plane = 0; plane < kPlanes; ++plane, row += plane_) {
      std::copy(row + columns_ - kBorder, row + columns_, row - kBorder);
      std::copy(row, row + kBorder, row + columns_);
    }
  }

  int columns_;
  int width_;
  std::size_t plane_;
  std::vector<float>& cells_;
};

/// Points whose windows are looked at together.
struct Points {
  Floats x, y, z, level;
};

/// Squared distance and difference of level of the cells in the windows about some points: one lane each.
template <int kRings, int kSteps>
class Window {
 public:
  /// Looks about the cells right of (ring, column), one for each of `own`, with steps of `stride` columns.
  FDI_LIO_INLINE void look(const CellImage& cells, int ring, int column, std::ptrdiff_t stride,
                           const Points& own) {
    const float* centre = cells.at(CellImage::kX, ring, column);
    int k = 0;
    for (std::ptrdiff_t r = -kRings; r <= kRings; ++r) {
      for (std::ptrdiff_t step = -kSteps; step <= kSteps; ++step) {
        if (r == 0 && step == 0) continue;
        const float* cell = centre + r * cells.width() + step * stride;
        Floats x, y, z, level;
        load(cell, &x);
        load(cell + CellImage::kY * cells.plane_size(), &y);
        load(cell + CellImage::kZ * cells.plane_size(), &z);
        load(cell + CellImage::kLevel * cells.plane_size(), &level);
        x -= own.x;
        y -= own.y;
        z -= own.z;
        level -= own.level;
        distance_sq_[k] = x * x + y * y + z * z;
        difference_[k++] = level < 0.0F ? -level : level;
      }
    }
  }

  FDI_LIO_INLINE void count_within(const Floats& radius_sq, Mask* count) const {
    *count = Mask{};
    for (int k = 0; k < kCells; ++k) *count -= distance_sq_[k] <= radius_sq;  // true is -1
  }

  /// Mean difference of those within the radius; 0 without any.
  FDI_LIO_INLINE void mean_within(const Floats& radius_sq, Floats* mean) const {
    Mask count{};
    *mean = Floats{};
    for (int k = 0; k < kCells; ++k) {
      const Mask is_within = distance_sq_[k] <= radius_sq;
      count -= is_within;
      *mean += is_within ? difference_[k] : Floats{};
    }
    *mean /= __builtin_convertvector(count > 0 ? count : Mask{} + 1, Floats);
  }

  /// Mean difference of the `wanted` nearest, and of others as near as the last of them, for the points in
  /// `asked`. The search for their radius starts from that of the points before.
  FDI_LIO_INLINE void mean_of_nearest(int wanted, const Mask& asked, Floats* mean) {
    constexpr float kGrowth = 1.4F;
    const Floats anywhere = Floats{} + kAnywhereSq;
    Mask count;
    count_within(anywhere, &count);
    const Mask has_more = asked & (count > wanted);
    Mask is_open = has_more;
    Floats radius_sq = has_more ? nearest_sq_ : anywhere;
    Floats lower{};
    Floats upper = anywhere;
    while (true) {
      count_within(radius_sq, &count);
      is_open &= count != wanted;
      if (!any(is_open)) break;
      const Mask is_short = count < wanted;
      lower = is_open & is_short ? radius_sq : lower;
      upper = is_open & ~is_short ? radius_sq : upper;
      Floats next = 0.5F * (lower + upper);
      next = upper == anywhere ? kGrowth * lower : next;
      next = lower == 0.0F ? upper / kGrowth : next;
      const Mask is_last = (next <= lower) | (next >= upper);
      next = is_last ? upper : next;
      radius_sq = is_open ? next : radius_sq;
      is_open &= ~is_last;
    }
    nearest_sq_ = has_more ? radius_sq : nearest_sq_;
    mean_within(radius_sq, mean);
  }

 private:
  static constexpr int kCells = (2 * kRings + 1) * (2 * kSteps + 1) - 1;

  alignas(kWideAlignment) std::array<Floats, kCells> distance_sq_{};
  alignas(kWideAlignment) std::array<Floats, kCells> difference_{};
  alignas(kWideAlignment) Floats nearest_sq_ = Floats{} + 1.0F;
};

/// Gradients of points, several at a time.
class Gradients {
 public:
  explicit Gradients(const GradientConfig& config)
      : always_radius_(config.neighbourhood == "radius"),
        always_nearest_(config.neighbourhood == "knn"),
        fine_sq_(static_cast<float>(config.fine_radius_m * config.fine_radius_m)),
        coarse_sq_(static_cast<float>(config.coarse_radius_m * config.coarse_radius_m)),
        fine_neighbours_(config.fine_neighbours),
        coarse_neighbours_(config.coarse_neighbours) {}

  /// Gradients of `own`, each about its cell right of (ring, column) with its own stride; 0: not wanted.
  FDI_LIO_INLINE void compute(const CellImage& cells, int ring, int column, const Points& own,
                              const Floats& strides, Floats* gradients) {
    *gradients = Floats{};
    Mask is_open = strides > 0.0F;
    // Nearly always all have the same.
    for (int lane = 0; lane < kWideLanes; ++lane) {
      if (is_open[lane] == 0) continue;
      const float stride = strides[lane];
      const Mask chosen = is_open & (strides == stride);
      is_open &= ~chosen;
      compute(cells, ring, column, static_cast<std::ptrdiff_t>(stride), own, chosen, gradients);
    }
  }

 private:
  FDI_LIO_INLINE void compute(const CellImage& cells, int ring, int column, std::ptrdiff_t stride,
                              const Points& own, const Mask& chosen, Floats* gradients) {
    fine_.look(cells, ring, column, stride, own);
    Mask near;
    fine_.count_within(Floats{} + fine_sq_, &near);
    const Mask is_dense = chosen & (near >= fine_neighbours_);
    const Mask is_sparse = chosen & ~is_dense;
    Floats mean;
    if (any(is_dense)) {
      if (always_nearest_) {
        fine_.mean_of_nearest(fine_neighbours_, is_dense, &mean);
      } else {
        fine_.mean_within(Floats{} + fine_sq_, &mean);
      }
      *gradients = is_dense ? mean : *gradients;
    }
    if (!any(is_sparse)) return;
    coarse_.look(cells, ring, column, stride, own);
    if (always_radius_) {
      coarse_.mean_within(Floats{} + coarse_sq_, &mean);
    } else {
      coarse_.mean_of_nearest(coarse_neighbours_, is_sparse, &mean);
    }
    *gradients = is_sparse ? mean : *gradients;
  }

  Window<kFineRings, kFineSteps> fine_;
  Window<kCoarseRings, kCoarseSteps> coarse_;
  bool always_radius_;
  bool always_nearest_;
  float fine_sq_;
  float coarse_sq_;
  int fine_neighbours_;
  int coarse_neighbours_;
};

FDI_LIO_WIDE_VECTORS void fill_ring(const GradientConfig& config, const DeskewedScan& scan,
                                    const std::vector<float>& levels, const RangeImage& image,
                                    const CellImage& cells, int ring, std::vector<float>* gradients) {
  Gradients several(config);
  Floats found;
  for (int column = 0; column < cells.columns(); column += kWideLanes) {
    Floats strides;
    load(cells.at(CellImage::kStride, ring, column), &strides);
    Points own;
    load(cells.at(CellImage::kX, ring, column), &own.x);
    load(cells.at(CellImage::kY, ring, column), &own.y);
    load(cells.at(CellImage::kZ, ring, column), &own.z);
    load(cells.at(CellImage::kLevel, ring, column), &own.level);
    several.compute(cells, ring, column, own, strides, &found);
    const int lanes = std::min(kWideLanes, cells.columns() - column);
    for (int lane = 0; lane < lanes; ++lane) {
      const std::uint32_t i = image.at(ring, column + lane);
      if (i != RangeImage::kNone) (*gradients)[i] = found[lane];
    }
  }
  // Where two points share a cell, the farther one is not in it.
  for (std::uint32_t i = scan.ring_begin[ring]; i < scan.ring_begin[ring + 1]; ++i) {
    const Point& point = scan.points[i];
    if (image.at(ring, point.column) == i) continue;
    const Points own = {Floats{} + point.position.x(), Floats{} + point.position.y(),
                        Floats{} + point.position.z(), Floats{} + levels[i]};
    const Floats stride = {*cells.at(CellImage::kStride, ring, point.column)};
    several.compute(cells, ring, point.column, own, stride, &found);
    (*gradients)[i] = found[0];
  }
}

}  // namespace

IntensityGradient::IntensityGradient(const GradientConfig& config) : config_(config) {}

std::vector<float> IntensityGradient::compute(const DeskewedScan& scan, const std::vector<float>& levels,
                                              const RangeImage& image) {
  std::vector<float> gradients(scan.points.size(), 0.0F);
  const float column_rad = 2.0F * static_cast<float>(M_PI) / static_cast<float>(image.columns());
  const CellImage cells(scan, levels, image, static_cast<float>(config_.sample_spacing_m) / column_rad,
                        &cells_);
  parallel_chunks(scan.ring_count(), 4, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t ring = begin; ring < end; ++ring)
      fill_ring(config_, scan, levels, image, cells, static_cast<int>(ring), &gradients);
  });
  return gradients;
}

}  // namespace fdi_lio::scan
