#pragma once

#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::matching {

/// What a scan tells of its pose, less an error that all of its points have in common, however many they are:
/// a turn by `sigma_rad` about each axis of the sensor (standard deviation), and a shift by as much as that
/// turn moves points at LidarInformation::radius_m. With the covariance S of both about [dtheta, dt],
///   H' = (H^-1 + S)^-1 = (I + H S)^-1 H,   b' = (I + H S)^-1 b,
/// so that the pose that the scan alone would have stays the same.
void add_common_error(double sigma_rad, LidarInformation* information);

}  // namespace fdi_lio::matching
