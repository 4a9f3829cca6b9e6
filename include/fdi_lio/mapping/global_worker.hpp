#pragma once

#include <functional>
#include <future>
#include <mutex>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/task_thread.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"

namespace fdi_lio::mapping {

/// A GlobalOptimizer in a thread of its own, so that odometry goes on while loops are verified. Keyframes are
/// taken in the order in which they come, so that the result is that of the synchronous optimiser.
class GlobalWorker {
 public:
  GlobalWorker(const Config& config, Reporter* reporter) : optimizer_(config, reporter) {}

  void add(Keyframe keyframe);

  /// Adds the keyframe that `make` gives; it is called in the thread.
  void add(std::function<Keyframe()> make);

  /// Adds a fix, which belongs to the keyframes about its stamp.
  void add_fix(const GnssFix& fix);

  /// Adds a pose of another odometry.
  void add_external(const ExternalPose& pose);

  /// Runs `job` in the thread, when everything that was added before is done; what is added meanwhile waits.
  /// What the job throws comes out of the future, and std::future_error when the worker ends before.
  std::future<void> run(std::function<void(const GlobalOptimizer&)> job);

  /// `run`, after the graph has taken in all loops and fixes: for what is saved.
  std::future<void> run_optimised(std::function<void(const GlobalOptimizer&)> job);

  /// The newest correction that is known.
  Eigen::Isometry3d T_map_odom() const;

  /// Keyframes and jobs that wait.
  std::size_t backlog() const { return thread_.backlog(); }

  /// Waits until no more than `backlog` keyframes and jobs wait.
  void wait_for_room(std::size_t backlog) { thread_.wait_for_room(backlog); }

  /// Milliseconds that each keyframe took.
  std::vector<double> durations_ms() const;

  /// What stopped the map (a full disk); empty while all is well. What came before can still be saved.
  std::string error() const;

  /// Waits until everything is done, and gives the optimiser. What is added afterwards is not done.
  const GlobalOptimizer& finish();

 private:
  void add_to_map(std::function<void()> action);

  GlobalOptimizer optimizer_;
  mutable std::mutex mutex_;
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
  std::string error_;
  std::vector<double> durations_ms_;
  TaskThread thread_;  ///< last: it uses what is above
};

}  // namespace fdi_lio::mapping
