// check_bag: says whether a recording fits a configuration, before SLAM is run on it.

#include <algorithm>
#include <cstdio>
#include <iostream>

#include "bag_options.hpp"
#include "bag_source.hpp"
#include "notice_log.hpp"
#include "start_check.hpp"

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"

namespace {

using fdi_lio::Error;
using fdi_lio::Severity;

const char* const kUsage =
    "usage: check_bag --config FILE --bag FILE... [--set key=value]... [--start S]\n"
    "Prints the topics of a recording, the recognised format of the lidar, and what does not fit the\n"
    "configuration. Exit code: 0 all is well, 1 there are warnings, 2 there are errors.\n";

void print_topics(const fdi_lio::tools::BagSource& source) {
  const double length_s = source.duration_s(0.0, 0.0);
  std::printf("%-32s %-32s %10s %10s\n", "topic", "type", "messages", "rate [Hz]");
  for (const fdi_lio::tools::BagTopic& topic : source.topics()) {
    const double rate_hz = length_s > 0.0 ? static_cast<double>(topic.messages) / length_s : 0.0;
    std::printf("%-32s %-32s %10zu %10.1f\n", topic.name.c_str(), topic.type.c_str(), topic.messages,
                rate_hz);
  }
}

/// Prints one finding and counts it by its severity.
void print(Severity severity, const std::string& text, int (*counts)[3]) {
  std::printf("%s: %s\n", fdi_lio::tools::name_of(severity), text.c_str());
  ++(*counts)[static_cast<int>(severity)];
}

int run(const fdi_lio::tools::BagOptions& options) {
  const fdi_lio::Config config = fdi_lio::load_config(options.config, options.overrides);
  fdi_lio::Reporter reporter;
  fdi_lio::tools::BagSource source(options.bags, config.sensor, &reporter);
  print_topics(source);
  const auto findings = fdi_lio::tools::check_start(&source, config, options.start_s, &reporter);
  int counts[3] = {0, 0, 0};
  for (const auto& entry : reporter.notices()) {
    const fdi_lio::Notice& notice = entry.second;
    print(notice.severity,
          notice.text + (notice.count > 1 ? " (" + std::to_string(notice.count) + " times)" : ""), &counts);
  }
  for (const fdi_lio::scan::Finding& finding : findings) print(finding.severity, finding.text, &counts);
  if (counts[2] > 0) {
    std::printf("verdict: %d errors, %d warnings: a run would give no useful result\n", counts[2], counts[1]);
  } else if (counts[1] > 0) {
    std::printf("verdict: %d warnings: it can run, read them first\n", counts[1]);
  } else {
    std::printf("verdict: the recording fits the configuration\n");
  }
  return counts[2] > 0 ? 2 : std::min(1, counts[1]);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(fdi_lio::tools::parse_bag_options(argc, argv, kUsage, false));
  } catch (const Error& error) {
    std::cerr << "check_bag: " << error.what() << "\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "check_bag: unexpected error: " << error.what() << "\n";
    return 3;
  }
}
