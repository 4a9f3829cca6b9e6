#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <thread>

namespace fdi_lio {

/// A thread that does tasks in the order in which they come.
class TaskThread {
 public:
  TaskThread() : thread_([this] { work(); }) {}

  /// Ends after the present task; those that wait are not done.
  ~TaskThread();
  TaskThread(const TaskThread&) = delete;
  TaskThread& operator=(const TaskThread&) = delete;

  /// What the task throws comes out of the future, and std::future_error when it will not be done.
  std::future<void> push(std::function<void()> task);

  /// Tasks that wait.
  std::size_t backlog() const;

  /// Waits until no more than `backlog` tasks wait.
  void wait_for_room(std::size_t backlog);

  /// Waits until all tasks are done. Those that come afterwards are not done.
  void finish();

 private:
  void work();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::packaged_task<void()>> waiting_;
  bool is_finishing_ = false;
  bool is_abandoned_ = false;
  std::thread thread_;  ///< last: it uses what is above
};

}  // namespace fdi_lio
