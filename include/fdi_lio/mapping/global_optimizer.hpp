#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/mapping/graph_file.hpp"
#include "fdi_lio/mapping/graph_measurements.hpp"
#include "fdi_lio/mapping/keyframe.hpp"
#include "fdi_lio/mapping/keyframe_store.hpp"
#include "fdi_lio/mapping/loop_types.hpp"
#include "fdi_lio/mapping/place_descriptor.hpp"

namespace fdi_lio::mapping {

/// The globally consistent map: keyframes, GNSS fixes and other odometry in, corrected poses and map -> odom
/// out. Looks for loops, verifies them, and optimises the pose graph when one is accepted. Synchronous and
/// deterministic.
class GlobalOptimizer {
 public:
  GlobalOptimizer(const Config& config, Reporter* reporter);
  ~GlobalOptimizer();

  /// Adds a keyframe; its stamp follows the one before. Loops are searched for and verified here, which may
  /// take a few hundred milliseconds.
  void add(Keyframe keyframe);

  /// Adds a fix. It is used when a keyframe of its stamp or later has come.
  void add_fix(const GnssFix& fix);

  /// Adds a pose of another odometry. It is used when it and the keyframes about it have come.
  void add_external(const ExternalPose& pose);

  /// Takes in the loops and fixes that came since the last optimisation. The more keyframes there are, the
  /// more of them come by itself between two.
  void optimise();

  /// `optimise`, and cleans the clouds that still wait for later keyframes (GhostRemover). To be called at
  /// the end.
  void finish();

  /// Where the map lies in ENU; nothing until the fixes have shown it.
  std::optional<EnuAlignment> alignment() const;

  /// The origin of that ENU: the first usable fix. Nothing before it.
  std::optional<GeodeticPoint> enu_origin() const;

  /// True way over the way that the other odometry says (external_odometry.*); 1 before it says anything.
  double external_scale() const;

  /// Every fix that was looked at.
  const std::vector<FixResult>& fixes() const;

  /// Correction of the newest keyframe: p_map = T_map_odom p_odom. Identity before the first.
  Eigen::Isometry3d T_map_odom() const;

  /// Corrected pose of something that the odometry saw at `stamp`: moved with the last keyframe up to then.
  Eigen::Isometry3d correct(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const;

  /// Every candidate that was looked at, in the order of the search.
  const std::vector<LoopCandidate>& loops() const;

  std::size_t size() const;
  Stamp stamp(std::size_t keyframe) const;
  const Eigen::Isometry3d& T_odom_imu(std::size_t keyframe) const;
  Eigen::Isometry3d T_map_imu(std::size_t keyframe) const;
  std::shared_ptr<const KeyframeCloud> cloud(std::size_t keyframe) const;
  /// The clouds of the keyframes before this one will not change any more.
  std::size_t cleaned() const;
  const PlaceDescriptor& place(std::size_t keyframe) const;
  double descriptor_range_m() const;
  /// That the clouds may take: what all keyframes need for the graph and the search leaves of
  /// `loop.cloud_memory`.
  std::size_t cloud_memory_bytes() const;
  GraphFile graph() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace fdi_lio::mapping
