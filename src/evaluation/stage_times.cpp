#include "fdi_lio/evaluation/stage_times.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <ostream>

#include <sys/resource.h>

namespace fdi_lio::evaluation {

namespace {

/// Nearest-rank percentile of sorted values.
double percentile(const std::vector<double>& sorted, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(sorted.size())));
  return sorted[std::clamp<std::size_t>(rank, 1, sorted.size()) - 1];
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

}  // namespace

void StageTimes::add(const std::string& stage, double milliseconds) {
  durations_ms_[stage].push_back(milliseconds);
}

void StageTimes::write_json(std::ostream& out, double wall_s, double bag_s) const {
  out << "{\n  \"stages\": {";
  const char* separator = "\n";
  for (const auto& [name, durations] : durations_ms_) {
    std::vector<double> sorted = durations;
    std::sort(sorted.begin(), sorted.end());
    const double mean =
        std::accumulate(sorted.begin(), sorted.end(), 0.0) / static_cast<double>(sorted.size());
    out << separator << "    \"" << name << "\": {\"count\": " << sorted.size() << ", \"mean\": " << mean
        << ", \"median\": " << percentile(sorted, 0.5) << ", \"p95\": " << percentile(sorted, 0.95)
        << ", \"p99\": " << percentile(sorted, 0.99) << ", \"max\": " << sorted.back() << "}";
    separator = ",\n";
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  out << "\n  },\n  \"wall_s\": " << wall_s
      << ",\n  \"cpu_s\": " << seconds(usage.ru_utime) + seconds(usage.ru_stime)
      << ",\n  \"peak_memory_mb\": " << static_cast<double>(usage.ru_maxrss) / 1024.0
      << ",\n  \"bag_s\": " << bag_s << "\n}\n";
}

}  // namespace fdi_lio::evaluation
