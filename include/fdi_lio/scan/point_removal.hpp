#pragma once

#include <vector>

#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::scan {

/// Moves the points with a reason out of `scan`, with all that is kept per point, to `scan->removed`.
void remove_points(const std::vector<RemovalReason>& reasons, DeskewedScan* scan);

}  // namespace fdi_lio::scan
