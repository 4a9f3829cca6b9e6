#pragma once

#include <vector>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

/// Points that hang in the air by themselves: dust, rain, snow, echoes between two surfaces. They bend the
/// ring that they lie in, so that the surface behind them looks rough on both sides.
///
/// A point at range r is isolated when fewer than `min_neighbours` of the cells about its own (3 rings x 5
/// columns) hold a point within
///   reach_m + reach_columns d,   d = 2 pi r / columns: spacing of the points along a ring,
/// so that a surface counts as one down to an angle of atan(1 / reach_columns) between it and the beam. After
/// Charron et al., "De-noising of lidar point clouds corrupted by snowfall", CRV 2018, whose radius grows
/// with the range alike; with a window instead of a search in all points.
///
/// Gives kIsolated or kNone for each point of `scan`, in its order; nothing when min_neighbours is 0.
std::vector<RemovalReason> find_isolated(const DeskewedScan& scan, const RangeImage& image,
                                         const IsolationConfig& config);

}  // namespace fdi_lio::scan
