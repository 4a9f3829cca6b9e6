#pragma once

#include <optional>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::scan {

/// What to do with a scan, judged by its stamp.
enum class StampVerdict {
  kAccept,   ///< it follows the scan before
  kDrop,     ///< repeated, late, or a jump that nothing confirms
  kRestart,  ///< a confirmed jump: a recording that was started again, or a clock that was set
};

/// Watches the stamps of successive scans. A jump of more than ten seconds is believed only when the next
/// scan follows it, so that one wrong stamp costs one scan, and a looped recording starts anew.
class StampGuard {
 public:
  StampVerdict check(Stamp stamp);

 private:
  std::optional<Stamp> newest_;
  std::optional<Stamp> jump_;  ///< a stamp far away that waits for confirmation
};

}  // namespace fdi_lio::scan
