#include "fdi_lio/mapping/global_worker.hpp"

#include <exception>
#include <utility>

namespace fdi_lio::mapping {

GlobalWorker::GlobalWorker(const Config& config)
    : optimizer_(config, &reporter_), thread_([this] { run(); }) {}

GlobalWorker::~GlobalWorker() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_abandoned_ = true;
  }
  changed_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void GlobalWorker::add(Keyframe keyframe) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_.push_back(std::move(keyframe));
  }
  changed_.notify_one();
}

Eigen::Isometry3d GlobalWorker::T_map_odom() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return T_map_odom_;
}

std::size_t GlobalWorker::backlog() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return waiting_.size();
}

std::string GlobalWorker::error() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return error_;
}

const GlobalOptimizer& GlobalWorker::finish() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_finishing_ = true;
  }
  changed_.notify_one();
  if (thread_.joinable()) thread_.join();
  optimizer_.finish();
  return optimizer_;
}

void GlobalWorker::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return !waiting_.empty() || is_finishing_ || is_abandoned_; });
    if (is_abandoned_ || waiting_.empty()) return;
    Keyframe keyframe = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    std::string error;
    try {
      optimizer_.add(std::move(keyframe));
    } catch (const std::exception& problem) {
      error = problem.what();
    }
    const Eigen::Isometry3d T_map_odom = optimizer_.T_map_odom();
    lock.lock();
    T_map_odom_ = T_map_odom;
    if (error.empty()) continue;
    error_ = error;
    return;
  }
}

}  // namespace fdi_lio::mapping
