#pragma once

#include <array>
#include <vector>

#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

/// Makes the intensities of one sensor comparable, whatever their scale (0-1, 0-255, 16 bit):
///   J = ln(1 + I (r / r_ref)^a / cos(theta)^b / s) - f(r) - g_ring
/// with the range r, the incidence theta, the scale s (the median of the first scan), what is left of a
/// dependence on range f, and the gain g of the beam. The logarithm makes a speckle of some per cent the same
/// everywhere and keeps retro-reflectors from hiding everything else.
///
/// f and g are learned while running, from pairs of neighbouring points on one surface. f is the integral of
/// its slope over ln r, which is the regression of the differences of J on those of ln r, by range; g draws
/// each beam towards its neighbours. Both would draw patterns on the ground that move with the sensor, and
/// pull the estimate towards standing still.
class IntensityModel {
 public:
  IntensityModel(const IntensityConfig& config, Reporter* reporter) : config_(config), reporter_(reporter) {}

  /// J of each point, in the order of `scan.points`; `image` is that of the scan. Empty when the scan's
  /// intensities say nothing: absent, all zero, or the same everywhere; the reason is reported once.
  std::vector<float> apply(const DeskewedScan& scan, const RangeImage& image);

  /// f at a range; 0 at the reference range.
  float range_profile(float range_m) const;

  /// g of each ring, in units of J.
  const std::vector<float>& gains() const { return gains_; }

 private:
  bool is_usable(const DeskewedScan& scan, float* median);
  void follow_scale(float median);
  static std::size_t range_bin(double range_m);
  void learn_range_profile(const RangeImage& image, const std::vector<float>& levels);
  void learn_gains(const RangeImage& image, const std::vector<float>& levels);

  IntensityConfig config_;
  Reporter* reporter_;
  float scale_ = 0.0F;  ///< 0: not known yet
  int differing_scans_ = 0;
  std::vector<float> gains_;
  int gain_scans_ = 0;
  static constexpr std::size_t kRangeBins = 16;  ///< half octaves from 1 m
  std::array<double, kRangeBins> cross_{};       ///< sums of dJ dln(r)
  std::array<double, kRangeBins> square_{};      ///< sums of dln(r)^2
  std::vector<float> profile_;                   ///< f by range, kProfileStep_m apart
};

}  // namespace fdi_lio::scan
