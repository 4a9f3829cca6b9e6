#pragma once

#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"

namespace fdi_lio::scan {

/// The work of the scan_deskew node: raw scan in, deskewed and ordered scan out.
class ScanProcessor {
 public:
  ScanProcessor(const Config& config, Reporter* reporter);

  /// Deskews with the motion that `imu` predicts from `state`, the newest estimate (at or before the scan).
  /// Without a state (first scan) the gyro alone is used; without readings constant velocity.
  DeskewedScan process(Scan scan, const std::optional<imu::NavState>& state, const imu::ImuBuffer& imu);

 private:
  Config config_;
  Reporter* reporter_;
};

}  // namespace fdi_lio::scan
