#pragma once

#include <iosfwd>
#include <map>
#include <string>
#include <vector>

namespace fdi_lio::evaluation {

/// Durations by stage, and what the process used.
class StageTimes {
 public:
  /// One duration in milliseconds.
  void add(const std::string& stage, double milliseconds);

  /// JSON: {"stages": {name: {"count", "mean", "median", "p95", "p99", "max"} in ms}, "wall_s", "cpu_s",
  /// "peak_memory_mb", "bag_s"}. CPU seconds and peak memory are those of this process so far.
  void write_json(std::ostream& out, double wall_s, double bag_s) const;

 private:
  std::map<std::string, std::vector<double>> durations_ms_;
};

}  // namespace fdi_lio::evaluation
