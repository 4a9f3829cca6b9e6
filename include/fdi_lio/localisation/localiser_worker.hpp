#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/task_thread.hpp"
#include "fdi_lio/localisation/localiser.hpp"

namespace fdi_lio::localisation {

/// A Localiser in a thread of its own, so that odometry goes on while scans are registered.
class LocaliserWorker {
 public:
  using ResultCallback = std::function<void(const LocalisationResult&)>;

  /// `on_result` is called in the thread. Throws Error when a cloud of the session cannot be read.
  LocaliserWorker(const Config& config, mapping::Session session, Reporter* reporter,
                  ResultCallback on_result);

  /// Whether a scan is worth its cloud: registrations are not late, and one may be due.
  bool wants(Stamp stamp) const;

  void add(mapping::Keyframe scan);
  void set_initial_pose(const InitialPose& pose);

  /// Forgets where it is; the session stays.
  void reset();

  /// p_map = T_map_odom p_odom; nothing before the place was found.
  std::optional<Eigen::Isometry3d> T_map_odom() const;

  /// The newest registration.
  std::optional<LocalisationResult> result() const;

  /// What went wrong; empty while all is well.
  std::string error() const;

  /// Waits until what was added is done.
  void finish() { thread_.finish(); }

  std::size_t keyframes() { return localiser_.session().size(); }

  /// The session's map, one mean point a voxel. To be called before scans are added.
  std::vector<Point> map_points(double voxel_m) { return localiser_.session().points(voxel_m); }

 private:
  Config config_;
  Localiser localiser_;
  ResultCallback on_result_;
  mutable std::mutex mutex_;
  std::optional<Eigen::Isometry3d> T_map_odom_;
  std::optional<LocalisationResult> result_;
  std::string error_;
  std::optional<Stamp> added_at_;
  std::uint64_t generation_ = 0;  ///< counts resets: what was added before one is not done any more
  TaskThread thread_;             ///< last: it uses what is above
};

}  // namespace fdi_lio::localisation
