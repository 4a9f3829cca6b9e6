#include "fdi_lio/scan/intensity_gradient.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::scan {

namespace {

constexpr int kLanes = 4;
/// Four floats in one register; comparisons give all ones or zeros. Written with arrays, the compiler makes
/// the masks one by one, and reading them back as four stalls for a third of the whole time.
using Floats = float __attribute__((vector_size(kLanes * sizeof(float))));
using Mask = std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

Floats to_floats(const Eigen::Array4f& values) {
  Floats floats;
  std::memcpy(&floats, values.data(), sizeof(floats));
  return floats;
}

Floats only_where(const Mask& mask, const Floats& values) {
  return reinterpret_cast<Floats>(reinterpret_cast<Mask>(values) & mask);
}
constexpr int kMaxStride = 16;
constexpr int kFineRings = 1;  ///< looked at above and below
constexpr int kFineSteps = 2;  ///< looked at to each side
constexpr int kCoarseRings = 2;
constexpr int kCoarseSteps = 4;

constexpr int window_cells(int rings, int steps) { return (2 * rings + 1) * (2 * steps + 1) - 1; }

/// Empty cells lie so far away [m] that no radius reaches them; squares of it are still finite.
constexpr float kNowhere_m = 1e15F;
constexpr float kAnywhereSq = 1e12F;

/// Position and level of the point in each cell of a range image: x, y, z, J; (kNowhere_m, 0, 0, 0) in empty
/// ones. A border of two empty rings, and of columns from the other side, makes checks in the windows
/// needless.
class CellImage {
 public:
  /// The cells are kept in `memory`, which is used again by the next scan.
  CellImage(const DeskewedScan& scan, const std::vector<float>& levels, const RangeImage& image,
            std::vector<Eigen::Array4f>* memory)
      : width_(image.columns() + 2 * kBorder), cells_(*memory) {
    const auto rows = static_cast<std::size_t>(image.rings() + 2 * kCoarseRings);
    cells_.assign(rows * static_cast<std::size_t>(width_), Eigen::Array4f(kNowhere_m, 0.0F, 0.0F, 0.0F));
    parallel_chunks(static_cast<std::size_t>(image.rings()), 8,
                    [&](std::size_t begin, std::size_t end, std::size_t) {
                      for (std::size_t ring = begin; ring < end; ++ring)
                        fill(scan, levels, image, static_cast<int>(ring));
                    });
  }

  int width() const { return width_; }

  const Eigen::Array4f* at(int ring, int column) const { return &cells_[index(ring, column)]; }

 private:
  static constexpr int kBorder = kCoarseSteps * kMaxStride;

  std::size_t index(int ring, int column) const {
    return static_cast<std::size_t>(ring + kCoarseRings) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(column + kBorder);
  }

  void fill(const DeskewedScan& scan, const std::vector<float>& levels, const RangeImage& image, int ring) {
    const int columns = image.columns();
    Eigen::Array4f* row = &cells_[index(ring, 0)];
    for (int column = 0; column < columns; ++column) {
      const std::uint32_t i = image.at(ring, column);
      if (i == RangeImage::kNone) continue;
      const Eigen::Vector3f& p = scan.points[i].position;
      row[column] = Eigen::Array4f(p.x(), p.y(), p.z(), levels[i]);
    }
    std::copy(row + columns - kBorder, row + columns, row - kBorder);
    std::copy(row, row + kBorder, row + columns);
  }

  int width_;
  std::vector<Eigen::Array4f>& cells_;
};

/// Squared distance and difference of level of the cells in a window about one point.
template <int kRings, int kSteps>
class Window {
 public:
  /// `width` is that of the image, `stride` the distance of two steps in columns.
  Window(int width, int stride) {
    int count = 0;
    for (int ring = -kRings; ring <= kRings; ++ring) {
      for (int step = -kSteps; step <= kSteps; ++step) {
        if (ring != 0 || step != 0) offsets_[count++] = ring * width + step * stride;
      }
    }
  }

  /// Looks about the cell `centre`, relative to the point `own`.
  void look(const Eigen::Array4f* centre, const Eigen::Array4f& own) {
    for (int group = 0; group < kGroups; ++group) {
      Eigen::Array44f difference;
      for (int lane = 0; lane < kLanes; ++lane)
        difference.col(lane) = centre[offsets_[group * kLanes + lane]] - own;
      difference.transposeInPlace();
      distance_sq_[group] =
          to_floats(difference.col(0).square() + difference.col(1).square() + difference.col(2).square());
      difference_[group] = to_floats(difference.col(3).abs());
    }
    for (int lane = kLanes - kPadding; lane < kLanes; ++lane) distance_sq_[kGroups - 1][lane] = kNowhere_m;
  }

  int within(float radius_sq) const {
    Mask count{};
    for (int group = 0; group < kGroups; ++group) count -= distance_sq_[group] <= radius_sq;  // true is -1
    return count[0] + count[1] + count[2] + count[3];
  }

  /// Mean difference of those within the radius; 0 without any.
  float mean_within(float radius_sq) const {
    const int count = within(radius_sq);
    if (count == 0) return 0.0F;
    Floats sum{};
    for (int group = 0; group < kGroups; ++group)
      sum += only_where(distance_sq_[group] <= radius_sq, difference_[group]);
    return (sum[0] + sum[1] + sum[2] + sum[3]) / static_cast<float>(count);
  }

  /// Mean difference of the `wanted` nearest, and of others as near as the last of them. The search for their
  /// radius starts from that of the point before.
  float mean_of_nearest(int wanted) {
    constexpr float kGrowth = 1.4F;
    if (within(kAnywhereSq) <= wanted) return mean_within(kAnywhereSq);
    float lower = 0.0F;
    float upper = kAnywhereSq;
    while (true) {
      const int count = within(nearest_sq_);
      if (count == wanted) break;
      (count < wanted ? lower : upper) = nearest_sq_;
      float next = 0.5F * (lower + upper);
      if (upper == kAnywhereSq) next = kGrowth * lower;
      if (lower == 0.0F) next = upper / kGrowth;
      if (next <= lower || next >= upper) {
        nearest_sq_ = upper;
        break;
      }
      nearest_sq_ = next;
    }
    return mean_within(nearest_sq_);
  }

 private:
  static constexpr int kCells = window_cells(kRings, kSteps);
  static constexpr int kGroups = (kCells + kLanes - 1) / kLanes;
  static constexpr int kPadding = kGroups * kLanes - kCells;

  std::array<std::ptrdiff_t, kGroups * kLanes> offsets_{};
  std::array<Floats, kGroups> distance_sq_{};
  std::array<Floats, kGroups> difference_{};
  float nearest_sq_ = 1.0F;
};

using FineWindow = Window<kFineRings, kFineSteps>;
using CoarseWindow = Window<kCoarseRings, kCoarseSteps>;

}  // namespace

IntensityGradient::IntensityGradient(const GradientConfig& config) : config_(config) {}

std::vector<float> IntensityGradient::compute(const DeskewedScan& scan, const std::vector<float>& levels,
                                              const RangeImage& image) {
  std::vector<float> gradients(scan.points.size(), 0.0F);
  const bool always_radius = config_.neighbourhood == "radius";
  const bool always_nearest = config_.neighbourhood == "knn";
  const auto fine_sq = static_cast<float>(config_.fine_radius_m * config_.fine_radius_m);
  const auto coarse_sq = static_cast<float>(config_.coarse_radius_m * config_.coarse_radius_m);
  const float column_rad = 2.0F * static_cast<float>(M_PI) / static_cast<float>(image.columns());
  const float spacing = static_cast<float>(config_.sample_spacing_m) / column_rad;
  const CellImage cells(scan, levels, image, &cells_);
  parallel_chunks(scan.ring_count(), 4, [&](std::size_t begin, std::size_t end, std::size_t) {
    std::vector<FineWindow> fine_windows;
    std::vector<CoarseWindow> coarse_windows;
    for (int stride = 1; stride <= kMaxStride; ++stride) {
      fine_windows.emplace_back(cells.width(), stride);
      coarse_windows.emplace_back(cells.width(), stride);
    }
    for (std::uint32_t i = scan.ring_begin[begin]; i < scan.ring_begin[end]; ++i) {
      const Point& point = scan.points[i];
      const Eigen::Array4f own(point.position.x(), point.position.y(), point.position.z(), levels[i]);
      const Eigen::Array4f* centre = cells.at(point.ring, point.column);
      const int stride = std::clamp(static_cast<int>(spacing / point.position.norm()), 1, kMaxStride);
      FineWindow& fine = fine_windows[stride - 1];
      fine.look(centre, own);
      if (fine.within(fine_sq) >= config_.fine_neighbours) {
        gradients[i] =
            always_nearest ? fine.mean_of_nearest(config_.fine_neighbours) : fine.mean_within(fine_sq);
        continue;
      }
      CoarseWindow& coarse = coarse_windows[stride - 1];
      coarse.look(centre, own);
      gradients[i] =
          always_radius ? coarse.mean_within(coarse_sq) : coarse.mean_of_nearest(config_.coarse_neighbours);
    }
  });
  return gradients;
}

}  // namespace fdi_lio::scan
