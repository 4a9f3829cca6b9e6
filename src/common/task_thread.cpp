#include "fdi_lio/common/task_thread.hpp"

#include <utility>

namespace fdi_lio {

TaskThread::~TaskThread() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_abandoned_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::future<void> TaskThread::push(std::function<void()> task) {
  std::packaged_task<void()> packaged(std::move(task));
  std::future<void> done = packaged.get_future();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    // A task that is not kept breaks its promise, which whoever waits for it learns.
    if (!is_finishing_ && !is_abandoned_) waiting_.push_back(std::move(packaged));
  }
  changed_.notify_all();
  return done;
}

std::size_t TaskThread::backlog() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return waiting_.size();
}

void TaskThread::wait_for_room(std::size_t backlog) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return waiting_.size() <= backlog; });
}

void TaskThread::finish() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_finishing_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void TaskThread::work() {
  std::unique_lock<std::mutex> lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return !waiting_.empty() || is_finishing_ || is_abandoned_; });
    if (is_abandoned_ || waiting_.empty()) return;
    std::packaged_task<void()> task = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    changed_.notify_all();
    task();
    lock.lock();
  }
}

}  // namespace fdi_lio
