#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/task_thread.hpp"

namespace fdi_lio {
namespace {

TEST(TaskThread, DoesTasksInOrderAndFinishWaitsForThem) {
  std::vector<int> done;
  TaskThread thread;
  for (int k = 0; k < 100; ++k) thread.push([&done, k] { done.push_back(k); });
  thread.finish();
  ASSERT_EQ(done.size(), 100U);
  for (int k = 0; k < 100; ++k) EXPECT_EQ(done[static_cast<std::size_t>(k)], k);
}

TEST(TaskThread, WaitsUntilThereIsRoom) {
  TaskThread thread;
  int done = 0;  // written by the tasks only, and read when they are done
  for (int k = 0; k < 1000; ++k) {
    thread.push([&done] { ++done; });
    thread.wait_for_room(2);
    EXPECT_LE(thread.backlog(), 2U);
  }
  thread.finish();
  EXPECT_EQ(done, 1000);
}

TEST(TaskThread, WhatATaskThrowsComesOutOfTheFutureAndTheNextIsDone) {
  TaskThread thread;
  std::future<void> bad = thread.push([] { throw std::runtime_error("bad"); });
  std::future<void> good = thread.push([] {});
  EXPECT_THROW(bad.get(), std::runtime_error);
  EXPECT_NO_THROW(good.get());
}

TEST(TaskThread, WhoWaitsForATaskThatIsNotDoneLearnsIt) {
  std::promise<void> go;
  std::future<void> abandoned;
  std::future<void> busy;
  {
    TaskThread thread;
    std::promise<void> begun;
    busy = thread.push([&] {
      begun.set_value();
      go.get_future().wait();
    });
    abandoned = thread.push([] {});
    begun.get_future().wait();
    EXPECT_EQ(thread.backlog(), 1U);
    std::thread later([&go] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      go.set_value();
    });
    later.detach();
  }
  EXPECT_NO_THROW(busy.get());
  EXPECT_THROW(abandoned.get(), std::future_error);
  TaskThread finished;
  finished.finish();
  EXPECT_THROW(finished.push([] {}).get(), std::future_error);
}

}  // namespace
}  // namespace fdi_lio
