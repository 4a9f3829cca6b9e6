#pragma once

#include <cstddef>
#include <deque>

#include <ros/time.h>

namespace fdi_lio::nodes {

/// Messages that a queue between two nodes holds.
constexpr std::size_t kQueue = 50;

/// The message of `queue` for `stamp`; drops what is older.
template <typename Message>
Message take(std::deque<Message>* queue, const ros::Time& stamp) {
  while (!queue->empty() && queue->front()->header.stamp < stamp) queue->pop_front();
  if (queue->empty() || queue->front()->header.stamp != stamp) return nullptr;
  Message message = queue->front();
  queue->pop_front();
  return message;
}

template <typename Message>
void keep(const Message& message, std::deque<Message>* queue) {
  // Stamps that go back are those of a recording that was started again.
  if (!queue->empty() && message->header.stamp < queue->back()->header.stamp) queue->clear();
  queue->push_back(message);
  if (queue->size() > kQueue) queue->pop_front();
}

}  // namespace fdi_lio::nodes
