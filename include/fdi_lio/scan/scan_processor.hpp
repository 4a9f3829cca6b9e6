#pragma once

#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/stage_timer.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/scan/dynamic_filter.hpp"
#include "fdi_lio/scan/gradient_smoother.hpp"
#include "fdi_lio/scan/intensity_gradient.hpp"
#include "fdi_lio/scan/intensity_model.hpp"
#include "fdi_lio/scan/range_image.hpp"

namespace fdi_lio::scan {

/// The work of the scan_deskew node: raw scan in; out comes the scan, deskewed, ordered, with its intensity
/// gradient and without what moves.
class ScanProcessor {
 public:
  /// The stages are "deskew" (with the order by ring, the range image and points
  /// that hang in the air), "intensity" (level, gradient,
  /// smoothing) and "dynamic".
  ScanProcessor(const Config& config, Reporter* reporter, StageTimer timer = StageTimer());

  /// Deskews with the motion that `imu` predicts from `state`, the newest estimate (at or before the scan).
  /// Without a state (first scan) the gyro alone is used; without readings constant velocity.
  DeskewedScan process(Scan scan, const std::optional<imu::NavState>& state, const imu::ImuBuffer& imu);

 private:
  /// The scan in the order of rings, without isolated points, with the image of its ranges in `image_`.
  DeskewedScan make_ordered(Scan* scan, const std::vector<imu::NavState>& trajectory);
  std::vector<imu::NavState> predict(const Scan& scan, const std::optional<imu::NavState>& state,
                                     const imu::ImuBuffer& imu) const;
  void add_intensity(const std::optional<Eigen::Isometry3d>& T_previous_lidar, DeskewedScan* scan);

  Config config_;
  Reporter* reporter_;
  StageTimer timer_;
  IntensityModel intensity_;
  IntensityGradient gradient_;
  GradientSmoother smoother_;
  DynamicFilter dynamic_;
  RangeImage image_;
  std::optional<Stamp> previous_stamp_;
};

}  // namespace fdi_lio::scan
