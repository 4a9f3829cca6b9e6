#pragma once

#include <chrono>
#include <string>

namespace fdi_lio::tools {

/// One line on a terminal: share done, ETA and speed against the recording's time. Silent when standard error
/// is no terminal.
class ProgressBar {
 public:
  /// `total_s` is the recording's length.
  explicit ProgressBar(double total_s);

  /// Redraws at most ten times a second.
  void update(double done_s);

  /// Ends the line.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;

  double total_s_;
  bool is_terminal_;
  Clock::time_point begin_;
  Clock::time_point drawn_;
};

}  // namespace fdi_lio::tools
