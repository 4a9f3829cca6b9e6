#pragma once

#include <functional>

#include <Eigen/Geometry>

#include "fdi_lio/simulation/route.hpp"
#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

/// Pose in map frame over seconds since the start of the recording.
using PoseFunction = std::function<Eigen::Isometry3d(double)>;

/// Whether something with this motion would come nearer (horizontally) than `distance` metres to the sensor.
bool comes_near(const PoseFunction& pose, const Trajectory& trajectory, double distance);

/// A car that follows `route` from arc length `start` like the sensor's vehicle does, `duration` seconds
/// long.
PoseFunction convoy_drive(const Route& route, const MotionSettings& motion, const Ground& ground,
                          double duration, double start);

}  // namespace fdi_lio::simulation
