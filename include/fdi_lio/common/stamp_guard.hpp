#pragma once

#include <optional>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio {

/// What to do with a scan or a reading, judged by its stamp.
enum class StampVerdict {
  kAccept,   ///< it follows the one before
  kDrop,     ///< repeated, late, or a jump that nothing confirms
  kRestart,  ///< a confirmed jump: a recording that was started again, or a clock that was set
};

/// Whether the step between two stamps, in either direction, is too long for what came before to mean
/// anything.
bool is_jump(Stamp from, Stamp to);

/// Watches the stamps of successive messages. A jump of more than ten seconds is believed only when the next
/// one follows it, so that one wrong stamp costs one message, and a looped recording starts anew.
class StampGuard {
 public:
  StampVerdict check(Stamp stamp);

  /// Forgets what came before.
  void reset() { *this = StampGuard(); }

 private:
  std::optional<Stamp> newest_;
  std::optional<Stamp> jump_;  ///< a stamp far away that waits for confirmation
};

}  // namespace fdi_lio
