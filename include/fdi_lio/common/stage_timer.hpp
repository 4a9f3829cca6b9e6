#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>

namespace fdi_lio {

/// Called with a stage's name and its duration in milliseconds.
using TimingCallback = std::function<void(const std::string&, double)>;

/// Tells a callback how long stages take; without one it costs nothing.
class StageTimer {
 public:
  explicit StageTimer(TimingCallback on_timing = nullptr) : on_timing_(std::move(on_timing)) {}

  /// Runs `stage` and gives what it returns.
  template <typename Stage>
  auto timed(const char* name, const Stage& stage) const {
    const auto begin = std::chrono::steady_clock::now();
    if constexpr (std::is_void_v<decltype(stage())>) {
      stage();
      note(name, begin);
    } else {
      auto result = stage();
      note(name, begin);
      return result;
    }
  }

 private:
  void note(const char* name, std::chrono::steady_clock::time_point begin) const {
    if (!on_timing_) return;
    on_timing_(name,
               std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }

  TimingCallback on_timing_;
};

}  // namespace fdi_lio
