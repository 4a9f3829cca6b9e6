#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/stage_timer.hpp"
#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/estimate_result.hpp"
#include "fdi_lio/odometry/start_review.hpp"

namespace fdi_lio::odometry {

class ScanEstimator;

/// The work of the mapping_optimization node: features and preintegrated IMU in, state out. Scans are
/// estimated one after the other (ScanEstimator); those of a start that turns out to have been in motion are
/// estimated anew (StartReview).
class Estimator {
 public:
  /// The stage "learning" is what the map and the beams get from a scan once its pose is known. It goes on
  /// while the next scan is prepared, and is told of with that.
  Estimator(const Config& config, Reporter* reporter, StageTimer timer = StageTimer());
  ~Estimator();

  /// Adds one scan. `imu` spans from the previous scan's stamp to this one's; nothing means that no IMU data
  /// exist for this interval. Nothing is returned (and the scan is counted) when its stamp does not follow
  /// the previous one.
  std::optional<EstimateResult> add(const FeatureSet& features, const degeneracy::Degeneracy& degeneracy,
                                    const std::optional<imu::Preintegration>& imu);

  /// Starts from a state that is known from before a restart, instead of from rest at the origin of `odom`.
  /// Only before the first scan; its stamp is that of the first scan.
  void resume(const imu::NavState& state);

  /// The newest state; nothing before the first scan.
  std::optional<imu::NavState> state() const;

  /// Points of the local map in `odom` (means of the filled voxels), for display.
  std::vector<Point> local_map() const;

  std::size_t map_voxel_count() const;

  void reset();

 private:
  std::optional<EstimateResult> add_to_review(EstimatorInput input);
  bool lies_after_first_reading(const EstimatorInput& input) const;
  EstimateResult begin_upright(EstimatorInput newest);
  EstimateResult begin_moving(const MovingStart& motion);
  EstimateResult add_again(std::vector<EstimatorInput> inputs);

  Config config_;
  Reporter* reporter_;
  StageTimer timer_;
  std::unique_ptr<ScanEstimator> scans_;
  std::optional<StartReview> review_;  ///< of the first scans, while it lasts
};

}  // namespace fdi_lio::odometry
