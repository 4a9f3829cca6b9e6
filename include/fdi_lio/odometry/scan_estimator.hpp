#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <tbb/task_group.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/stage_timer.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/matching/local_map.hpp"
#include "fdi_lio/odometry/adaptation.hpp"
#include "fdi_lio/odometry/beam_correction.hpp"
#include "fdi_lio/odometry/brightness_watch.hpp"
#include "fdi_lio/odometry/calibration_report.hpp"
#include "fdi_lio/odometry/estimate_result.hpp"
#include "fdi_lio/odometry/estimator_input.hpp"
#include "fdi_lio/odometry/imu_start.hpp"
#include "fdi_lio/odometry/map_candidate.hpp"
#include "fdi_lio/odometry/moving_start.hpp"
#include "fdi_lio/odometry/scan_aligner.hpp"
#include "fdi_lio/odometry/shock_guard.hpp"
#include "fdi_lio/odometry/smoother.hpp"
#include "fdi_lio/odometry/stated_covariance.hpp"

namespace fdi_lio::odometry {

/// Estimates scan after scan: prediction by the IMU, registration to the local map with the fixed-lag
/// smoother, what each scan then gives the map and the beams, and when the map knows nothing any more.
class ScanEstimator {
 public:
  ScanEstimator(const Config& config, Reporter* reporter, const StageTimer& timer);
  ~ScanEstimator();
  ScanEstimator(const ScanEstimator&) = delete;
  ScanEstimator& operator=(const ScanEstimator&) = delete;

  /// Adds one scan; nothing is returned when its stamp does not follow the one before. `is_reviewed`: what is
  /// estimated may yet be revised, and is no keyframe.
  std::optional<EstimateResult> add(EstimatorInput input, bool is_reviewed);

  /// The velocity in `odom` of the first scan. Only before it.
  void begin_moving(const MovingStart& motion) { moving_start_ = motion; }

  /// Starts from a state that is known from before a restart. Only before the first scan.
  void resume(const imu::NavState& state) { resumed_ = state; }

  /// The first two scans alone told the velocity.
  bool has_found_motion() const { return has_found_motion_; }

  /// The IMU was started as at rest.
  bool seems_to_stand() const { return seems_to_stand_; }

  /// What the alignment of scans and IMU in motion says of the first scan, once it was made of all scans.
  const std::optional<MovingStart>& aligned_start() const { return aligned_start_; }

  /// The newest state; nothing before the first scan.
  std::optional<imu::NavState> state() const;

  /// Points of the local map in `odom` (means of the filled voxels), for display. Waits for `learning`.
  std::vector<Point> local_map();
  std::size_t map_voxel_count();

 private:
  void start(const FeatureSet& features, const std::optional<imu::Preintegration>& imu);
  void predict(const FeatureSet& features, const std::optional<imu::Preintegration>& imu);
  void search_motion(const FeatureSet& first, const std::optional<imu::Preintegration>& imu,
                     FeatureSet* features);
  bool adopt_motion(const FeatureSet& first, const std::optional<imu::Preintegration>& imu,
                    FeatureSet* features);
  void begin_with_velocity(const Eigen::Vector3d& v_odom, const FeatureSet& first,
                           const std::optional<imu::Preintegration>& imu, FeatureSet* features);
  Eigen::Vector3d deskew_velocity(const Eigen::Vector3d& v_deskew, bool is_reviewed) const;
  FeatureSet deskewed_anew(FeatureSet features, const Eigen::Vector3d& v_before,
                           const Eigen::Vector3d& v_odom) const;
  void match(const FeatureSet& features, const std::optional<imu::Preintegration>& imu,
             EstimateResult* result);
  void watch_velocity(const FeatureSet& features, const Eigen::Vector3d& v_deskew);
  void take_up_imu(const std::optional<imu::Preintegration>& imu);
  void adopt_imu(const std::optional<ImuStart::Found>& found);
  void start_smoother(const imu::NavState& state, Smoother::InitialSigma sigma);
  Eigen::Vector3d bend_to(const imu::NavState& predicted) const;
  void state_uncertainty(const Matrix15d& covariance, EstimateResult* result);
  bool review_map(const FeatureSet& features, const EstimateResult& result, const Matrix15d& covariance);
  void begin_map_anew(const EstimateResult& result, const Matrix15d& covariance);
  double take_out_beam_elevation();
  void learn(FeatureSet features, const EstimateResult& result);
  bool decide_keyframe(bool is_reviewed);

  Config config_;
  Reporter* reporter_;
  StageTimer timer_;
  Eigen::Isometry3d T_imu_lidar_;
  Smoother smoother_;
  matching::LocalMap map_;
  StatedCovariance stated_;
  CalibrationReport calibration_report_;
  MapCandidate candidate_;
  ImuStart imu_start_;
  BeamCorrection beams_;
  BrightnessWatch brightness_;
  ShockGuard shock_guard_;
  ScanAligner aligner_;
  TrustedInformation trusted_information_;  ///< Alignment's, of the newest scan
  std::optional<FeatureSet> first_;         ///< the first scan, until the second has come
  /// About the first scan, in odom; only where nothing but an alignment in motion tells which way is up.
  std::optional<Eigen::Vector3d> ground_normal_;
  bool has_found_motion_ = false;
  bool seems_to_stand_ = false;
  std::optional<MovingStart> moving_start_;
  std::optional<MovingStart> aligned_start_;
  std::optional<imu::NavState> resumed_;
  AdaptedSettings adapted_;
  double radius_m_ = 0.0;  ///< of the features matched last
  double common_elevation_sigma_rad_ = 0.0;
  int scan_count_ = 0;
  int map_scans_ = 0;  ///< since the local map was begun
  bool has_restarted_ = false;
  imu::NavState before_;                                 ///< estimate of the scan before
  Eigen::Vector3d v_earlier_ = Eigen::Vector3d::Zero();  ///< of the one before that
  bool has_keyframe_ = false;
  Eigen::Isometry3d T_odom_keyframe_ = Eigen::Isometry3d::Identity();
  double learning_ms_ = 0.0;
  /// What the newest scan gives the map and the beams, which the next one needs: it goes on while that one is
  /// prepared. Last: it uses what is above.
  tbb::task_group learning_;
};

}  // namespace fdi_lio::odometry
