#pragma once

#include "fdi_lio/common/reporter.hpp"

namespace fdi_lio::tools {

/// "info", "warning" or "error".
const char* name_of(Severity severity);

/// Writes what became due since the last call (`Reporter::take_new`) to standard error, a line each.
void print_new(Reporter* reporter);

}  // namespace fdi_lio::tools
