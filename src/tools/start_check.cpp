#include "start_check.hpp"

#include <optional>
#include <string>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::tools {

namespace {
/// Drivers start at different times: the first scan is waited for so many times `check.duration`.
constexpr double kPatience = 10.0;
}  // namespace

std::vector<scan::Finding> check_start(BagSource* source, const Config& config, double start_s,
                                       Reporter* reporter) {
  scan::DataCheck check(config);
  bool has_scan = false;
  std::optional<double> first_scan_s;
  BagCallbacks callbacks;
  callbacks.on_imu = [&check](const imu::ImuSample& sample) { check.add_imu(sample); };
  callbacks.on_scan = [&](const Scan& scan) {
    check.add_scan(scan);
    has_scan = true;
  };
  callbacks.on_timing = [](const std::string& /*stage*/, double /*ms*/) {};
  callbacks.on_progress = [&](double position_s) {
    if (has_scan && !first_scan_s) first_scan_s = position_s;
    const double duration_s = config.check.duration_s;
    return position_s < (first_scan_s ? *first_scan_s + duration_s : kPatience * duration_s);
  };
  source->read(start_s, 0.0, reporter, callbacks);
  return check.findings();
}

void require_good_start(BagSource* source, const Config& config, double start_s, Reporter* reporter) {
  Reporter of_messages;  // the run itself will report them
  const std::vector<scan::Finding> findings = check_start(source, config, start_s, &of_messages);
  if (scan::report_findings(findings, reporter)) {
    std::string text;
    for (const scan::Finding& finding : findings) text += "\n  - " + finding.text;
    throw Error("the recording does not fit the configuration:" + text +
                "\nMend that, or go on regardless with --set check.enabled=false");
  }
}

}  // namespace fdi_lio::tools
