#include "fdi_lio/scan/receive_clock.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::scan {

namespace {
constexpr double kDrift = 1e-4;  ///< of one clock against the other
constexpr double kJumpS = 1.0;
}  // namespace

Stamp ReceiveClock::to_received(Stamp stamp, Stamp received) {
  const Stamp now = received - stamp;
  if (!offset_ || std::abs(seconds_between(offset_->received_minus_stamp, now)) > kJumpS) {
    offset_ = Offset{now, received};
    return received;
  }
  const double elapsed_s = std::max(0.0, seconds_between(offset_->received, received));
  offset_->received_minus_stamp =
      std::min(now, add_seconds(offset_->received_minus_stamp, kDrift * elapsed_s));
  offset_->received = received;
  return stamp + offset_->received_minus_stamp;
}

}  // namespace fdi_lio::scan
