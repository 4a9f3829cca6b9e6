#pragma once

#include <cstddef>

#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::mapping {

/// Notices when the estimate has gone wrong, and names the likely cause.
///
/// - **Unmatched**: a scan with fewer than 30 matches, or with matches for less than a tenth of its features,
///   says nothing of the pose: the sensor may have left the local map in a gap without scans, or the pose has
///   run away. What becomes of the map is up to MapCandidate; 50 such scans in a row are reported as lost.
/// - **Contradiction**: the pose that the IMU predicts and the one that the scan gives are farther apart than
///   both say, again and again. The normalised innovation e' P^-1 e, with e the correction and P the
///   covariance of the prediction, is 6 on the average if P is right; here it is 0.1 to 0.3, for P is
///   cautious, and 6 and more with a mounting that is wrong by 20 degrees.
/// - **Implausible biases**: no sensor in use has them, so something else hides in them.
class HealthMonitor {
 public:
  explicit HealthMonitor(Reporter* reporter) : reporter_(reporter) {}

  /// Whether a scan's matches are enough to correct its pose.
  static bool is_matched(std::size_t matched, std::size_t features);

  /// A scan was not matched: its pose is a prediction.
  void add_unmatched();

  /// Takes what became of a matched scan. `innovation_sq`: e' P^-1 e; negative when there was no prediction
  /// by an IMU.
  void add(double innovation_sq, const imu::NavState& state);

  /// The local map was begun anew.
  void restart();

 private:
  void check_innovation(double innovation_sq);
  void check_biases(const imu::NavState& state);

  Reporter* reporter_;
  int unmatched_ = 0;    ///< in a row
  int innovations_ = 0;  ///< since the map was begun
  double mean_innovation_sq_ = 0.0;
};

}  // namespace fdi_lio::mapping
