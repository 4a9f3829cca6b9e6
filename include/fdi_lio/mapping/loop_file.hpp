#pragma once

#include <string>
#include <vector>

#include "fdi_lio/mapping/loop_types.hpp"

namespace fdi_lio::mapping {

/// Writes every candidate as a line of a CSV file: stamps, source, verdict, how the registration went, the
/// pose T_from_to and the upper triangle of its covariance [dtheta, dt]. Written under another name first and
/// then renamed. Throws Error when the file cannot be written.
void write_loops(const std::string& path, const std::vector<LoopCandidate>& loops);

}  // namespace fdi_lio::mapping
