#include "fdi_lio/common/stamp_guard.hpp"

#include <cmath>

namespace fdi_lio {

namespace {
constexpr double kJumpS = 10.0;
constexpr double kConfirmS = 1.0;
}  // namespace

bool is_jump(Stamp from, Stamp to) { return std::abs(seconds_between(from, to)) > kJumpS; }

StampVerdict StampGuard::check(Stamp stamp) {
  if (!newest_) {
    newest_ = stamp;
    return StampVerdict::kAccept;
  }
  const double step = seconds_between(*newest_, stamp);
  if (!is_jump(*newest_, stamp)) {
    jump_.reset();
    if (step <= 0.0) return StampVerdict::kDrop;
    newest_ = stamp;
    return StampVerdict::kAccept;
  }
  const double since_jump = jump_ ? seconds_between(*jump_, stamp) : 0.0;
  jump_ = stamp;
  if (since_jump <= 0.0 || since_jump > kConfirmS) return StampVerdict::kDrop;
  newest_ = stamp;
  jump_.reset();
  return StampVerdict::kRestart;
}

}  // namespace fdi_lio
