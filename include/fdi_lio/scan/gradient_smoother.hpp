#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

/// Scalar Kalman filter on the intensity gradient of each place:
///   P' = P + Q,  K = P' / (P' + R),  x = x' + K (z - x'),  P = (1 - K) P'.
/// The state of a point is that of the cell of the previous range image in which motion compensation predicts
/// it, not that of its array index. A point whose predicted cell was empty or saw another surface starts
/// anew.
class GradientSmoother {
 public:
  explicit GradientSmoother(const GradientConfig& config) : config_(config) {}

  /// Smooths `gradients` (in the order of `scan.points`) in place and returns the stability of each point,
  /// stab = exp(-|z - x'| / sqrt(P' + R)) in [0, 1]; 0 where there was nothing to predict from.
  /// `T_previous_lidar` is this scan's lidar pose in the previous scan's lidar frame; nothing starts all
  /// anew.
  std::vector<float> update(const DeskewedScan& scan, const RangeImage& image,
                            const std::optional<Eigen::Isometry3d>& T_previous_lidar,
                            std::vector<float>* gradients);

  void reset() { previous_.reset(); }

 private:
  struct State {
    RangeImage image;
    std::vector<float> mean;  ///< per point of that scan
    std::vector<float> variance;
  };

  GradientConfig config_;
  std::optional<State> previous_;
};

}  // namespace fdi_lio::scan
