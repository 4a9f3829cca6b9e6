#pragma once

#include "fdi_lio/common/reporter.hpp"

namespace fdi_lio::odometry {

/// Watches for changes of velocity that no vehicle makes. A blow is over before the readings of an
/// accelerometer tell its height, or exceeds their range; what is left of it looks like a change of velocity
/// by metres per second.
class ShockGuard {
 public:
  /// `shock_acceleration_mps2`: a mean acceleration between two scans that may be false altogether.
  ShockGuard(double shock_acceleration_mps2, Reporter* reporter)
      : shock_acceleration_mps2_(shock_acceleration_mps2), reporter_(reporter) {}

  /// Takes what the IMU says that the velocity changed by from one scan to the next. Returns what is doubtful
  /// of it: nothing while its mean acceleration is below half of the shock's, all from that on, a share that
  /// grows evenly between.
  double add(double change_mps, double duration_s);

  /// The prediction of the newest scan is not to be relied on: it may be off by more than 2 cm, or that of
  /// one of the two scans before it was.
  bool is_shocked() const { return scans_ > 0; }

 private:
  double shock_acceleration_mps2_;
  Reporter* reporter_;
  int scans_ = 0;  ///< that are not to be predicted, the newest included
};

}  // namespace fdi_lio::odometry
