#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/global_optimizer.hpp"

namespace fdi_lio::mapping {

/// A GlobalOptimizer in a thread of its own, so that odometry goes on while loops are verified. Keyframes are
/// taken in the order in which they come, so that the result is that of the synchronous optimiser.
class GlobalWorker {
 public:
  explicit GlobalWorker(const Config& config);
  ~GlobalWorker();
  GlobalWorker(const GlobalWorker&) = delete;
  GlobalWorker& operator=(const GlobalWorker&) = delete;

  void add(Keyframe keyframe);

  /// The newest correction that is known.
  Eigen::Isometry3d T_map_odom() const;

  /// Keyframes that wait.
  std::size_t backlog() const;

  /// What ended the thread before its time (a full disk); empty while all is well.
  std::string error() const;

  /// Waits until everything is done, and gives the optimiser. Nothing may be added afterwards.
  const GlobalOptimizer& finish();

 private:
  void run();

  Reporter reporter_;  ///< of the thread
  GlobalOptimizer optimizer_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Keyframe> waiting_;
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
  std::string error_;
  bool is_finishing_ = false;
  bool is_abandoned_ = false;
  std::thread thread_;  ///< last: it uses what is above
};

}  // namespace fdi_lio::mapping
