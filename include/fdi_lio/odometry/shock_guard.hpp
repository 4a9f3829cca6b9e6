#pragma once

#include <Eigen/Core>

#include "fdi_lio/common/reporter.hpp"

namespace fdi_lio::odometry {

/// Watches for changes of velocity that no vehicle makes, and keeps what the scans show that the IMU missed.
/// A blow is over before the readings of an accelerometer tell its height, or exceeds their range; what is
/// left of it looks like a change of velocity by metres per second.
class ShockGuard {
 public:
  /// `shock_acceleration_mps2`: a mean acceleration between two scans that may be false altogether.
  ShockGuard(double shock_acceleration_mps2, Reporter* reporter)
      : shock_acceleration_mps2_(shock_acceleration_mps2), reporter_(reporter) {}

  /// Takes what the IMU says that the velocity changed by from one scan to the next. Returns what is doubtful
  /// of it: nothing while its mean acceleration is below half of the shock's, all from that on, a share that
  /// grows evenly between; and what the accelerometer missed last, while it is in doubt.
  double add(double change_mps, double duration_s);

  /// The gyro has missed this turn before the newest scan (rotation vector, body frame).
  void note_missed_turn(const Eigen::Vector3d& turn);

  /// The accelerometer has missed this step before the newest scan, and may miss a change of velocity of
  /// `doubtful_mps` before each of the next.
  void note_missed_step(double step_m, double doubtful_mps);
  bool is_accel_doubtful() const { return doubtful_velocity_mps_ > 0.0; }

  /// What the gyro missed last, and may miss once more before the newest scan; zero while it is not in doubt.
  const Eigen::Vector3d& doubtful_turn() const { return doubtful_turn_; }
  bool is_gyro_doubtful() const { return !doubtful_turn_.isZero(0.0); }

  /// The prediction of the newest scan is not to be relied on: it may be off by more than 2 cm, or that of
  /// one of the two scans before it was.
  bool is_shocked() const { return scans_ > 0; }

 private:
  /// A velocity that one scan tells is off by what its position is, over the time since the scan before: it
  /// takes a few until the prediction is as good as ever.
  static constexpr int kScans = 3;

  double shock_acceleration_mps2_;
  Reporter* reporter_;
  int scans_ = 0;  ///< that are not to be predicted, the newest included
  double doubtful_velocity_mps_ = 0.0;
  Eigen::Vector3d doubtful_turn_ = Eigen::Vector3d::Zero();
};

}  // namespace fdi_lio::odometry
