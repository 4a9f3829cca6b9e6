#pragma once

#include <vector>

#include "bag_source.hpp"

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/scan/data_check.hpp"

namespace fdi_lio::tools {

/// What scan::DataCheck finds in the recording from `start_s` until `check.duration` after the first scan.
/// The layout of the clouds, and what was wrong with single messages, goes to `reporter`.
std::vector<scan::Finding> check_start(BagSource* source, const Config& config, double start_s,
                                       Reporter* reporter);

/// The same before a run: warnings go to `reporter`. Throws Error with all findings when one is an error.
void require_good_start(BagSource* source, const Config& config, double start_s, Reporter* reporter);

}  // namespace fdi_lio::tools
