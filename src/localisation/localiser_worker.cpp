#include "fdi_lio/localisation/localiser_worker.hpp"

#include <algorithm>
#include <exception>
#include <memory>
#include <utility>

namespace fdi_lio::localisation {

namespace {

/// Scans that may wait; a registration that is late is worth less than the odometry since.
constexpr std::size_t kBacklog = 5;

}  // namespace

LocaliserWorker::LocaliserWorker(const Config& config, mapping::Session session, Reporter* reporter,
                                 ResultCallback on_result)
    : config_(config), localiser_(config, std::move(session), reporter), on_result_(std::move(on_result)) {}

bool LocaliserWorker::wants(Stamp stamp) const {
  if (thread_.backlog() >= kBacklog) return false;
  const std::lock_guard<std::mutex> lock(mutex_);
  const LocalisationConfig& config = config_.localisation;
  return !added_at_ ||
         seconds_between(*added_at_, stamp) >= std::min(config.period_s, config.search_period_s);
}

void LocaliserWorker::add(mapping::Keyframe scan) {
  if (thread_.backlog() >= kBacklog) return;
  std::uint64_t generation = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    added_at_ = scan.stamp;
    generation = generation_;
  }
  thread_.push([this, generation, scan = std::make_shared<mapping::Keyframe>(std::move(scan))] {
    std::optional<LocalisationResult> result;
    std::string error;
    try {
      result = localiser_.add(*scan);
    } catch (const std::exception& problem) {
      error = problem.what();
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (generation != generation_) return;
      T_map_odom_ = localiser_.T_map_odom();
      error_ = error;
      if (result) result_ = result;
    }
    if (result && on_result_) on_result_(*result);
  });
}

void LocaliserWorker::set_initial_pose(const InitialPose& pose) {
  thread_.push([this, pose] { localiser_.set_initial_pose(pose); });
}

void LocaliserWorker::reset() {
  thread_.push([this] { localiser_.reset(); });
  const std::lock_guard<std::mutex> lock(mutex_);
  ++generation_;
  T_map_odom_.reset();
  result_.reset();
  added_at_.reset();
}

std::optional<Eigen::Isometry3d> LocaliserWorker::T_map_odom() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return T_map_odom_;
}

std::optional<LocalisationResult> LocaliserWorker::result() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return result_;
}

std::string LocaliserWorker::error() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return error_;
}

}  // namespace fdi_lio::localisation
