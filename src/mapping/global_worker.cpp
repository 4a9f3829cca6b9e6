#include "fdi_lio/mapping/global_worker.hpp"

#include <chrono>
#include <exception>
#include <memory>
#include <utility>

namespace fdi_lio::mapping {

/// Does `action` in the thread, unless an earlier one failed: then the map stays as it is.
void GlobalWorker::add_to_map(std::function<void()> action) {
  thread_.push([this, action = std::move(action)] {
    if (!error().empty()) return;
    std::string problem;
    try {
      action();
    } catch (const std::exception& error) {
      problem = error.what();
    }
    const Eigen::Isometry3d T_map_odom = optimizer_.T_map_odom();
    const std::lock_guard<std::mutex> lock(mutex_);
    T_map_odom_ = T_map_odom;
    error_ = problem;
  });
}

void GlobalWorker::add(Keyframe keyframe) {
  // A std::function has to be copyable, a keyframe should not be copied.
  const auto shared = std::make_shared<Keyframe>(std::move(keyframe));
  add([shared] { return std::move(*shared); });
}

void GlobalWorker::add(std::function<Keyframe()> make) {
  add_to_map([this, make = std::move(make)] {
    const auto begin = std::chrono::steady_clock::now();
    optimizer_.add(make());
    const std::chrono::duration<double, std::milli> duration = std::chrono::steady_clock::now() - begin;
    const std::lock_guard<std::mutex> lock(mutex_);
    durations_ms_.push_back(duration.count());
  });
}

void GlobalWorker::add_fix(const GnssFix& fix) {
  add_to_map([this, fix] { optimizer_.add_fix(fix); });
}

void GlobalWorker::add_external(const ExternalPose& pose) {
  add_to_map([this, pose] { optimizer_.add_external(pose); });
}

std::future<void> GlobalWorker::run(std::function<void(const GlobalOptimizer&)> job) {
  return thread_.push([this, job = std::move(job)] { job(optimizer_); });
}

std::future<void> GlobalWorker::run_optimised(std::function<void(const GlobalOptimizer&)> job) {
  add_to_map([this] { optimizer_.optimise(); });
  return run(std::move(job));
}

Eigen::Isometry3d GlobalWorker::T_map_odom() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return T_map_odom_;
}

std::vector<double> GlobalWorker::durations_ms() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return durations_ms_;
}

std::string GlobalWorker::error() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return error_;
}

const GlobalOptimizer& GlobalWorker::finish() {
  thread_.finish();
  optimizer_.finish();
  return optimizer_;
}

}  // namespace fdi_lio::mapping
