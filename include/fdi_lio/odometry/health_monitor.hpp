#pragma once

#include <cstddef>
#include <optional>

#include <Eigen/Geometry>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// Notices when the estimate has gone wrong, and names the likely cause.
///
/// - **Unmatched**: a scan with fewer than 30 matches, or with matches for less than a tenth of its features,
///   says nothing of the pose: the sensor may have left the local map in a gap without scans, or the pose has
///   run away. Where few beams see open ground, the map of the first scans knows hardly anything of any scan,
///   so that 0.4 of the usual share is enough there. What becomes of the map is up to MapCandidate; 50 such
///   scans in a row are reported as lost.
/// - **Contradiction**: the pose that the IMU predicts and the one that the scan gives are farther apart than
///   both say, again and again: e' (P + R)^-1 e, with e the correction, P the covariance of the prediction
///   and R that of scans that do not quite fit the map (1 mrad, 1 cm: beams, edges, the map's own errors),
///   is above 0.5 on the average over 50 scans. P is cautious, so that it stays below 0.2 while all is well.
/// - **Conspicuous** is a single scan that matches far less than the ones before (least_usual_share()), or
///   contradicts its prediction far more (suddenness()): the IMU may have missed something (ScanAligner).
/// - **Implausible biases**: no sensor in use has them, so something else hides in them.
class HealthMonitor {
 public:
  explicit HealthMonitor(Reporter* reporter) : reporter_(reporter) {}

  /// R: covariance of scans that do not quite fit the map, beyond what they state; order [dtheta (body), dt
  /// (odom)].
  static Matrix6d misfit() { return isotropic(1e-3, 0.01); }

  /// How many of a scan's features must find matches, so that these can correct its pose.
  std::size_t least_matches(std::size_t features) const;

  /// The share of its features that a scan finds matches for unless something is wrong, by the ones before; 0
  /// where the map knows less than half of those.
  double least_usual_share() const;

  /// A scan was not matched: its pose is a prediction.
  void add_unmatched();

  /// Pose of the IMU in odom predicted by it for a scan, and its covariance, order [dtheta (body), dt
  /// (odom)].
  struct Prediction {
    Eigen::Isometry3d T_odom_imu = Eigen::Isometry3d::Identity();
    Matrix6d covariance = Matrix6d::Identity();
    bool is_shaken = false;  ///< vibration drowns the readings: what they contradict says nothing
  };

  /// How suddenly a matched scan contradicts its prediction: e' (P + R)^-1 e over 0.1 or ten times its
  /// average, whichever is more, so that above 1 something happened. 0 within the first 30 scans of a map,
  /// while vibration drowns the readings, and where the map usually knows less than half of the features.
  double suddenness(const Prediction& prediction, const imu::NavState& state) const;

  /// Takes what became of a matched scan, with the share of its features that found matches; no `prediction`
  /// where the IMU gave none.
  void add(const std::optional<Prediction>& prediction, const imu::NavState& state, double matched_share);

  /// The local map was begun anew.
  void restart();

  /// Whether the map usually knows half of the features, so that the share of matches tells something.
  bool is_well_known() const;

 private:
  void check_innovation(const Prediction& prediction, const imu::NavState& state);
  void check_biases(const imu::NavState& state);

  Reporter* reporter_;
  int unmatched_ = 0;                  ///< in a row
  std::optional<double> usual_share_;  ///< of the features that the map knows
  int innovations_ = 0;                ///< since the map was begun
  double mean_innovation_sq_ = 0.0;
};

}  // namespace fdi_lio::odometry
