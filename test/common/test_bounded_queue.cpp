#include <atomic>
#include <memory>
#include <thread>

#include <gtest/gtest.h>

#include "fdi_lio/common/bounded_queue.hpp"

namespace fdi_lio {
namespace {

TEST(BoundedQueue, HandsEverythingOverInOrderAndNeverHoldsMoreThanItsCapacity) {
  BoundedQueue<std::unique_ptr<int>> queue(3);
  std::atomic<int> pushed{0};
  int popped = 0;
  std::thread producer([&] {
    for (int k = 0; k < 1000; ++k) {
      EXPECT_TRUE(queue.push(std::make_unique<int>(k)));
      ++pushed;
    }
    queue.close();
  });
  while (const auto value = queue.pop()) {
    EXPECT_EQ(**value, popped++);
    EXPECT_LE(pushed - popped, 3);
  }
  producer.join();
  EXPECT_EQ(popped, 1000);
}

TEST(BoundedQueue, WhoWaitsForRoomLearnsThatItIsClosed) {
  BoundedQueue<int> queue(1);
  ASSERT_TRUE(queue.push(1));
  std::thread producer([&] { EXPECT_FALSE(queue.push(2)); });
  queue.close();
  producer.join();
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

}  // namespace
}  // namespace fdi_lio
