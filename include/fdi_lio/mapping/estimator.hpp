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
#include "fdi_lio/mapping/pose_tangent.hpp"
#include "fdi_lio/mapping/start_review.hpp"

namespace fdi_lio::mapping {

/// What one scan gave.
struct EstimateResult {
  imu::NavState state;  ///< at the scan's reference stamp
  /// Of T_odom_imu against the origin of odom, drift included, order [dtheta (body), dt (odom)].
  Matrix6d covariance = Matrix6d::Identity();
  /// The same against the local map alone: what this scan's registration and the IMU leave open.
  Matrix6d map_covariance = Matrix6d::Identity();
  Eigen::Matrix3d velocity_covariance = Eigen::Matrix3d::Identity();  ///< in odom axes
  degeneracy::OptimisationStatus status;
  /// Information along each of the status's axes, and what the noise alone would give [1/m^2].
  Eigen::Matrix<double, 6, 1> axis_information = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> axis_noise = Eigen::Matrix<double, 6, 1>::Zero();
  bool is_keyframe = false;
  bool is_healthy = true;  ///< false: no match was possible, the pose is a prediction
  std::size_t matched_planes = 0;
  std::size_t matched_edges = 0;
  std::size_t matched_textures = 0;
  /// States of earlier scans that were wrong: a start turned out to be in motion. In time order, mostly
  /// empty.
  std::vector<imu::NavState> revised;
};

/// The work of the mapping_optimization node: features and preintegrated IMU in, state out. Holds the
/// fixed-lag smoother and the local map.
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
  class Implementation;
  EstimateResult begin_moving(const MovingStart& motion);

  Config config_;
  Reporter* reporter_;
  StageTimer timer_;
  std::unique_ptr<Implementation> implementation_;
  std::optional<StartReview> review_;  ///< of the first scans, while it lasts
};

}  // namespace fdi_lio::mapping
