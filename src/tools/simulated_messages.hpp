#pragma once

#include <string>

#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>
#include <sensor_msgs/NavSatFix.h>
#include <sensor_msgs/PointCloud2.h>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/simulation/cloud_encoding.hpp"
#include "fdi_lio/simulation/gnss_simulator.hpp"
#include "fdi_lio/simulation/imu_simulator.hpp"
#include "fdi_lio/simulation/trajectory.hpp"
#include "fdi_lio/simulation/wheel_simulator.hpp"

namespace fdi_lio::tools {

/// A cloud in the layout of the sensor's driver.
sensor_msgs::PointCloud2 to_message(simulation::EncodedCloud cloud, Stamp stamp, const std::string& frame);

/// Covariances are those of white noise at the sensor's rate; without nine axes there is no orientation (-1).
sensor_msgs::Imu to_message(const simulation::ImuReading& reading, const simulation::ImuSettings& settings,
                            Stamp stamp);

/// The true pose of `imu_link` in `map`, and its velocity in its own axes.
nav_msgs::Odometry to_message(const simulation::MotionState& state, Stamp stamp);

/// Planar odometry; the variances of z, roll and pitch say that they are not known.
nav_msgs::Odometry to_message(const simulation::WheelReading& reading,
                              const simulation::WheelSettings& settings, Stamp stamp);

/// A fix, or with NaN and STATUS_NO_FIX what a receiver without one sends.
sensor_msgs::NavSatFix to_message(const simulation::GnssFix& fix, const simulation::GnssSettings& settings,
                                  Stamp stamp);

}  // namespace fdi_lio::tools
