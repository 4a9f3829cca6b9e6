#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <type_traits>
#include <utility>

#include <tbb/parallel_invoke.h>

namespace fdi_lio {

/// Called with a stage's name and its duration in milliseconds.
using TimingCallback = std::function<void(const std::string&, double)>;

/// Tells a callback how long stages take; without one it costs nothing. The callback is called by the thread
/// that uses the timer, also for stages that ran in others.
class StageTimer {
 public:
  explicit StageTimer(TimingCallback on_timing = nullptr) : on_timing_(std::move(on_timing)) {}

  /// Runs `stage` and gives what it returns.
  template <typename Stage>
  auto timed(const char* name, const Stage& stage) const {
    const auto begin = std::chrono::steady_clock::now();
    if constexpr (std::is_void_v<decltype(stage())>) {
      stage();
      note(name, milliseconds_since(begin));
    } else {
      auto result = stage();
      note(name, milliseconds_since(begin));
      return result;
    }
  }

  /// Runs two stages that do not depend on each other side by side, where there are threads.
  template <typename First, typename Second>
  void timed_together(const char* first_name, const First& first, const char* second_name,
                      const Second& second) const {
    const auto duration_ms = [](const auto& stage) {
      const auto begin = std::chrono::steady_clock::now();
      stage();
      return milliseconds_since(begin);
    };
    double first_ms = 0.0;
    double second_ms = 0.0;
    tbb::parallel_invoke([&] { first_ms = duration_ms(first); }, [&] { second_ms = duration_ms(second); });
    note(first_name, first_ms);
    note(second_name, second_ms);
  }

  /// Tells of a stage that was timed elsewhere.
  void note(const char* name, double duration_ms) const {
    if (on_timing_) on_timing_(name, duration_ms);
  }

 private:
  static double milliseconds_since(std::chrono::steady_clock::time_point begin) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  }

  TimingCallback on_timing_;
};

}  // namespace fdi_lio
