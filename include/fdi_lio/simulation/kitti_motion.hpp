#pragma once

#include <string>

#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

/// Motion from a KITTI pose file: rows of a 3x4 matrix, the camera's pose (z forward, y down) 10 times a
/// second. The poses become vehicle poses (x forward, z up), are smoothed over about 0.15 s, and their mean
/// height becomes 0. Throws Error if the file cannot be read or is shorter than `duration` seconds.
Trajectory load_kitti_motion(const std::string& path, double duration);

}  // namespace fdi_lio::simulation
