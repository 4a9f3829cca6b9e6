#pragma once

#include <optional>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::scan {

/// Stamps of a sensor whose clock is none of the host's, moved to the clock by which its messages were
/// received: stamp + offset, where the offset is the least (received - stamp) so far. Messages come late by
/// varying times, never early, so the least has the least delay in it; it may rise by 1e-4 of the time, more
/// than clocks drift apart. What every message is late by at least is left in, and is for
/// sensor.lidar_time_offset. When either clock jumps by more than a second, the offset is learnt anew.
class ReceiveClock {
 public:
  /// Messages in the order in which they came.
  Stamp to_received(Stamp stamp, Stamp received);

 private:
  struct Offset {
    Stamp received_minus_stamp;  ///< [ns]
    Stamp received;              ///< of the message that it was last held against
  };
  std::optional<Offset> offset_;
};

}  // namespace fdi_lio::scan
