#pragma once

#include <string>

#include <visualization_msgs/MarkerArray.h>

#include "fdi_lio/degeneracy/degeneracy_types.hpp"

namespace fdi_lio::ros_bridge {

/// What rviz shows of a degeneracy, in the IMU frame:
///   `fdi`              text: FDI, class, each sub-factor with its weight, weak directions with their
///   probability `weak_directions`  for each axis whose localizability is below one half: a double arrow
///   along the part of
///                      the axis that is a translation, or a ring about the part that is a rotation,
///                      whichever is larger; red is not observed, yellow half. Axes that are observed are
///                      deleted.
/// Markers disappear by themselves when no new ones come for a second.
visualization_msgs::MarkerArray degeneracy_markers(const degeneracy::Degeneracy& degeneracy,
                                                   const std::string& imu_frame);

}  // namespace fdi_lio::ros_bridge
