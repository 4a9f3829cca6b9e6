#include "progress_bar.hpp"

#include <algorithm>
#include <cstdio>

#include <unistd.h>

namespace fdi_lio::tools {

ProgressBar::ProgressBar(double total_s)
    : total_s_(total_s), is_terminal_(isatty(STDERR_FILENO) != 0), begin_(Clock::now()), drawn_(begin_) {}

void ProgressBar::update(double done_s) {
  const Clock::time_point now = Clock::now();
  if (!is_terminal_ || now - drawn_ < std::chrono::milliseconds(100)) return;
  drawn_ = now;
  const double elapsed = std::chrono::duration<double>(now - begin_).count();
  const double share = total_s_ > 0.0 ? std::clamp(done_s / total_s_, 0.0, 1.0) : 0.0;
  const double speed = elapsed > 0.0 ? done_s / elapsed : 0.0;
  const double eta = speed > 0.0 ? std::max(0.0, total_s_ - done_s) / speed : 0.0;
  constexpr int kWidth = 30;
  const std::string bar(static_cast<std::size_t>(share * kWidth), '#');
  std::fprintf(stderr, "\r[%-30s] %5.1f %%  ETA %4.0f s  %5.2f x real time ", bar.c_str(), 100.0 * share, eta,
               speed);
}

void ProgressBar::finish() {
  if (is_terminal_) std::fprintf(stderr, "\n");
}

}  // namespace fdi_lio::tools
