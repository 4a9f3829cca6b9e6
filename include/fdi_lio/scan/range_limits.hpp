#pragma once

#include <cmath>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::scan {

/// Squared ranges that are kept. In a header because it is asked for every point.
struct RangeLimits {
  float min_sq;  ///< [m^2]
  float max_sq;  ///< [m^2]

  explicit RangeLimits(const SensorConfig& sensor)
      : min_sq(static_cast<float>(sensor.min_range_m * sensor.min_range_m)),
        max_sq(static_cast<float>(sensor.max_range_m * sensor.max_range_m)) {}

  /// Whether a point (lidar frame, metres) can be used; counts it when not.
  bool accept(const Eigen::Vector3f& position, DropCounts* dropped) const {
    const float range_sq = position.squaredNorm();
    if (range_sq >= min_sq && range_sq <= max_sq && range_sq > 0.0F) return true;
    if (!std::isfinite(range_sq)) {
      ++dropped->non_finite;
    } else if (range_sq == 0.0F) {
      ++dropped->zero;
    } else {
      ++dropped->out_of_range;
    }
    return false;
  }
};

}  // namespace fdi_lio::scan
