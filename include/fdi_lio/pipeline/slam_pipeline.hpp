#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/stage_timer.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/estimator.hpp"

namespace fdi_lio::pipeline {

/// Everything that one scan gave.
struct ScanOutput {
  DeskewedScan scan;
  FeatureSet features;
  degeneracy::Degeneracy degeneracy;
  odometry::EstimateResult estimate;
};

/// All five stages in one process, in the order in which the nodes work: what `offline_slam` runs.
class SlamPipeline {
 public:
  using OutputCallback = std::function<void(ScanOutput)>;

  SlamPipeline(const Config& config, Reporter* reporter, OutputCallback on_output, TimingCallback on_timing);
  ~SlamPipeline();

  /// Takes one IMU reading; scans that waited for it are processed.
  void add_imu(const imu::ImuSample& sample);

  /// Takes one scan; it is processed as soon as IMU readings reach its last point, or when the next scan
  /// comes.
  void add_scan(Scan scan);

  /// Processes what still waits.
  void finish();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace fdi_lio::pipeline
