#pragma once

#include <vector>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

/// Two-scale intensity gradient of each point, IDG_i = (1 / |N_i|) sum_{j in N_i} |J_j - J_i|.
///
/// Candidates for N_i come from a window of the range image about the point's own cell, without that cell: 3
/// rings x 5 columns for the fine scale, 5 x 9 for the coarse one; near the sensor, where a column is
/// narrower than `sample_spacing`, every s-th column. Of these the k nearest are taken (knn), or all within
/// the scale's radius (radius). The local density chooses the scale: rho_i = n_i / (4/3 pi fine_radius^3),
/// where n_i counts the points of the fine window within `fine_radius`. From `fine_neighbours` of them on it
/// is the fine scale, else the coarse one.
class IntensityGradient {
 public:
  explicit IntensityGradient(const GradientConfig& config);

  /// Gradient of each point, in the order of `scan.points`; 0 where a point has no neighbour.
  /// `levels` are the intensities of IntensityModel::apply, of the same size.
  std::vector<float> compute(const DeskewedScan& scan, const std::vector<float>& levels,
                             const RangeImage& image);

 private:
  GradientConfig config_;
  std::vector<float> cells_;  ///< memory of `compute`
};

}  // namespace fdi_lio::scan
