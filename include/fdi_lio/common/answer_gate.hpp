#pragma once

#include <cstdint>
#include <optional>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio {

/// How long a stage waits for what another one says of a scan: until it comes, but never longer than a time
/// limit, and not at all once the other has been silent for that long, until it speaks again. So a stage that
/// dies costs one waiting time, not one for each scan.
class AnswerGate {
 public:
  explicit AnswerGate(double timeout_s) : timeout_s_(timeout_s) {}

  /// The other stage said something of the scan `stamp`; older and repeated stamps change nothing but that it
  /// lives.
  void answered(Stamp stamp) {
    if (!newest_ || stamp > *newest_) newest_ = stamp;
    is_silent_ = false;
  }

  /// Whether to go on with what is known, `waited_s` after the wait for `stamp` began.
  bool is_open(Stamp stamp, double waited_s) {
    if (has_answered(stamp) || is_silent_) return true;
    if (waited_s < timeout_s_) return false;
    is_silent_ = true;
    ++timeouts_;
    return true;
  }

  bool has_answered(Stamp stamp) const { return newest_ && *newest_ >= stamp; }

  std::uint64_t timeouts() const { return timeouts_; }

  /// True once for each time that the other stage fell silent.
  bool take_timeout() {
    const bool is_new = timeouts_ != taken_;
    taken_ = timeouts_;
    return is_new;
  }

  /// Forgets the answers: stamps start anew.
  void reset() { newest_.reset(); }

 private:
  double timeout_s_;
  std::optional<Stamp> newest_;
  bool is_silent_ = false;
  std::uint64_t timeouts_ = 0;
  std::uint64_t taken_ = 0;
};

}  // namespace fdi_lio
