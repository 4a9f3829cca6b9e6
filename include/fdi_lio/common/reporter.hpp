#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace fdi_lio {

enum class Severity { kInfo, kWarning, kError };

/// One thing that the user should know, with how often it has happened.
struct Notice {
  Severity severity = Severity::kInfo;
  std::string text;         ///< the newest wording
  std::uint64_t count = 0;  ///< occurrences since the reporter was made
};

/// Collects notices by key, so that data problems are counted instead of flooding a log. The library never
/// prints; nodes and tools take `take_new()` to a log and `notices()` to diagnostics. Threads may share one.
class Reporter {
 public:
  /// Counts one occurrence of `key`. The text is handed out by `take_new()` at occurrence 1, 10, 100, ...
  void report(Severity severity, const std::string& key, const std::string& text);

  /// Notices that became due since the last call, oldest first.
  std::vector<Notice> take_new();

  /// All notices by key.
  std::map<std::string, Notice> notices() const;

  /// Whether `key` has been reported.
  bool has(const std::string& key) const;

 private:
  mutable std::mutex mutex_;
  std::map<std::string, Notice> notices_;
  std::vector<Notice> due_;
};

}  // namespace fdi_lio
