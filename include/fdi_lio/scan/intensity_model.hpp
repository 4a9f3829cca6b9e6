#pragma once

#include <vector>

#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

/// Makes the intensities of one sensor comparable, whatever their scale (0-1, 0-255, 16 bit):
///   J = ln(1 + I (r / r_ref)^a / cos(theta)^b / s) - g_ring
/// with the range r, the incidence theta, the scale s (the median of the first scan) and the gain g of the
/// beam. The logarithm makes a speckle of some per cent the same everywhere and keeps retro-reflectors from
/// hiding everything else.
///
/// Gains are learned while running: each beam is drawn towards the mean of its two neighbours on surfaces
/// that they share. Beams of unequal gain would draw rings on the ground that move with the sensor, and pull
/// the estimate towards standing still.
class IntensityModel {
 public:
  IntensityModel(const IntensityConfig& config, Reporter* reporter) : config_(config), reporter_(reporter) {}

  /// J of each point, in the order of `scan.points`; `image` is that of the scan. Empty when the scan's
  /// intensities say nothing: absent, all zero, or the same everywhere; the reason is reported once.
  std::vector<float> apply(const DeskewedScan& scan, const RangeImage& image);

  /// g of each ring, in units of J.
  const std::vector<float>& gains() const { return gains_; }

 private:
  bool is_usable(const DeskewedScan& scan, float* median);
  void follow_scale(float median);
  void learn_gains(const RangeImage& image, const std::vector<float>& levels);

  IntensityConfig config_;
  Reporter* reporter_;
  float scale_ = 0.0F;  ///< 0: not known yet
  int differing_scans_ = 0;
  std::vector<float> gains_;
  int gain_scans_ = 0;
};

}  // namespace fdi_lio::scan
