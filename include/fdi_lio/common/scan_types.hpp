#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio {

/// One lidar return in the lidar frame.
struct Point {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< metres
  float intensity = 0.0F;                              ///< the sensor's own scale
  float time_s = 0.0F;       ///< seconds relative to the scan's reference stamp (<= 0)
  std::uint16_t ring = 0;    ///< beam, 0 is the lowest
  std::uint16_t column = 0;  ///< azimuth bin of the range image, filled by scan::RangeImage::build
};

/// What the conversion of one message dropped, by reason.
struct DropCounts {
  std::size_t non_finite = 0;
  std::size_t zero = 0;
  std::size_t out_of_range = 0;  ///< of distance, or of the ring's number
  std::size_t duplicate = 0;

  std::size_t total() const { return non_finite + zero + out_of_range + duplicate; }
};

/// One sweep as the sensor measured it: every point in the lidar frame at its own time.
struct Scan {
  Stamp stamp = 0;          ///< reference stamp: time of the last point
  double duration_s = 0.0;  ///< from the first to the last point; 0 when the cloud has no time
  std::vector<Point> points;
  bool has_time = false;           ///< false: already deskewed, or time could not be reconstructed
  bool time_from_azimuth = false;  ///< the cloud had no usable time: it was reconstructed
  bool has_intensity = false;      ///< false: intensity is absent, and all zero here
  std::uint16_t ring_count = 0;
  DropCounts dropped;
};

/// Why a point was removed: as moving (scan::DynamicFilter), or as hanging in the air (scan::find_isolated).
enum class RemovalReason : std::uint8_t {
  kNone = 0,
  kCriterion = 1,     ///< plain criterion: intensity gradient and range jump
  kFreeSpace = 2,     ///< earlier scans saw through its place
  kPartOfObject = 3,  ///< touches points whose place was free
  kIsolated = 4,      ///< no surface and no object: dust, rain, snow
};

/// How the lidar moved during a sweep, in its frame at the stamp of the scan. `ago`: how long before the end,
/// as a share of the sweep.
struct Sweep {
  static constexpr int kSteps = 8;

  Sweep() { axes.fill(Eigen::Vector3f::UnitZ()); }

  /// Where it was when a point was seen [m].
  Eigen::Vector3f origin(float ago) const { return ago * start; }

  /// Its z axis then, which a ring is a cone about.
  Eigen::Vector3f axis(float ago) const {
    const float position = (1.0F - ago) * static_cast<float>(kSteps);
    const auto step = static_cast<std::size_t>(std::clamp(static_cast<int>(position), 0, kSteps - 1));
    return axes[step] + (position - static_cast<float>(step)) * (axes[step + 1] - axes[step]);
  }

  Eigen::Vector3f start = Eigen::Vector3f::Zero();  ///< where it was at the beginning [m]
  std::array<Eigen::Vector3f, kSteps + 1> axes;     ///< z axis at the beginning and after each eighth
};

/// A sweep moved to one instant, ordered ring by ring and by azimuth within each ring.
struct DeskewedScan {
  Stamp stamp = 0;
  double duration_s = 0.0;
  Sweep sweep;                            ///< at rest where its motion is not known
  std::vector<Point> points;              ///< lidar frame at `stamp`
  std::vector<std::uint32_t> ring_begin;  ///< ring r is points[ring_begin[r], ring_begin[r + 1])
  bool has_intensity = false;
  /// Per point, empty where intensity is absent or off: comparable intensity J (scan::IntensityModel), its
  /// smoothed gradient, and how well the smoothing predicted it, [0, 1].
  std::vector<float> intensity_level;
  std::vector<float> intensity_gradient;
  std::vector<float> gradient_stability;
  std::vector<Point> removed;                  ///< points that moved, or hung in the air
  std::vector<RemovalReason> removal_reasons;  ///< of `removed`

  /// Of `removed`, those on moving objects.
  std::size_t moving_count() const {
    return removal_reasons.size() -
           static_cast<std::size_t>(
               std::count(removal_reasons.begin(), removal_reasons.end(), RemovalReason::kIsolated));
  }

  std::size_t ring_count() const { return ring_begin.empty() ? 0 : ring_begin.size() - 1; }
};

/// Features of one scan, lidar frame at `stamp`.
struct FeatureSet {
  Stamp stamp = 0;
  std::vector<Point> planes;
  std::vector<Point> edges;
  /// High intensity gradient on smooth surfaces. Their `intensity` is the comparable one, J.
  std::vector<Point> intensity_edges;
  std::vector<float> plane_scores;
  std::vector<float> edge_scores;
  std::vector<float> intensity_scores;
};

}  // namespace fdi_lio
