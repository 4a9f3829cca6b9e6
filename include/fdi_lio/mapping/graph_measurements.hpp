#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/mapping/external_odometry.hpp"
#include "fdi_lio/mapping/gnss_aligner.hpp"
#include "fdi_lio/mapping/odometry_frame.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// What became of one GNSS fix.
struct FixResult {
  Stamp stamp = 0;
  GnssVerdict verdict = GnssVerdict::kWaiting;
};

/// What is known of the keyframes besides odometry and loops: gravity, GNSS fixes, and another odometry.
/// Keeps what waits for its keyframes, and puts into the pose graph what has them.
class GraphMeasurements {
 public:
  GraphMeasurements(const Config& config, Reporter* reporter);

  /// Roll and pitch of the newest frame, whose pose in the map is `T_map_imu`. The odometry knows them by the
  /// accelerometer, and what moves the map must not tilt it (the four degrees of freedom of VINS-Mono, Qin et
  /// al., T-RO 2018, section VIII). `down_imu` is what the frame itself says, zero while it does not know;
  /// then down in odom, as the first frame of the session said that knew it, is carried on by the odometry.
  void add_gravity(const std::vector<OdometryFrame>& frames, const Eigen::Isometry3d& T_map_imu,
                   const Eigen::Vector3d& down_imu, PoseGraph* graph);

  /// Roll and pitch of a frame, instead of what it said itself: the way down in its axes and in the map.
  void set_gravity(std::size_t frame, const Eigen::Vector3d& down_imu, const Eigen::Vector3d& down_map,
                   PoseGraph* graph) const;

  void add_fix(const GnssFix& fix) { waiting_fixes_.push_back(fix); }

  /// What is no pose, or does not follow the one before, is reported and dropped.
  void add_external(const ExternalPose& pose);

  /// Puts into `graph` what has its keyframes, `poses` being T_map_imu of `frames` (at least one). True when
  /// the graph should be solved now; then there may be more.
  bool use(const std::vector<OdometryFrame>& frames, const std::vector<Eigen::Isometry3d>& poses,
           PoseGraph* graph);

  /// The graph was solved.
  void solved() { unsolved_ = 0; }

  /// Fixes and steps of the other odometry since then.
  int unsolved() const { return unsolved_; }

  bool is_aligned() const { return is_aligned_; }
  std::optional<GeodeticPoint> enu_origin() const { return aligner_.origin(); }

  /// `alignment` of the graph with the height that the fixes say: where altitudes do not move the map
  /// (gnss.use_altitude), the graph knows nothing of it, and it is the median over the fixes in the graph.
  EnuAlignment with_height(EnuAlignment alignment, const std::vector<Eigen::Isometry3d>& poses) const;

  bool has_external() const { return external_next_ > 0; }
  const std::vector<FixResult>& fixes() const { return fixes_; }

 private:
  void add_position(const PositionFix& position, PoseGraph* graph);
  bool use_fix(const GnssFix& fix, const TiedFix& tied, PoseGraph* graph);
  void use_external(const std::vector<OdometryFrame>& frames, PoseGraph* graph);

  double gravity_sigma_rad_;
  int solve_every_;
  Eigen::Vector3d p_imu_antenna_;
  bool use_altitude_;
  Reporter* reporter_;
  std::optional<Eigen::Vector3d> down_odom_, down_map_;
  GnssAligner aligner_;
  std::deque<GnssFix> waiting_fixes_;
  std::vector<FixResult> fixes_;
  std::vector<PositionFix> positions_;  ///< those in the graph
  bool is_aligned_ = false;
  ExternalOdometry external_;
  std::size_t external_next_ = 0;  ///< the frame whose step to the next waits for the other odometry
  int unsolved_ = 0;
};

}  // namespace fdi_lio::mapping
