#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/simulation/imu_simulator.hpp"
#include "fdi_lio/simulation/lidar_simulator.hpp"
#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"

namespace fdi_lio::simulation {

/// Ground truth of the IMU as a TUM file.
class TumWriter {
 public:
  explicit TumWriter(const std::string& path);
  void add(Stamp stamp, const Eigen::Isometry3d& T_map_imu);
  /// Throws Error if not everything could be written.
  void close();

 private:
  std::string path_;
  std::ofstream out_;
};

/// Labels of the points, little endian: per scan the header stamp (int64, nanoseconds), the number of points
/// (uint32) and a label (int16) for each point in the order of the cloud; 0 is static, otherwise the moving
/// object's id.
class LabelWriter {
 public:
  explicit LabelWriter(const std::string& path);
  void add(Stamp stamp, const std::vector<std::int16_t>& labels);
  /// Throws Error if not everything could be written.
  void close();

 private:
  std::string path_;
  std::ofstream out_;
};

/// What was drawn for a recording: seed, where a tunnel begins on the way (`tunnel_begin_x_m`, map frame),
/// true mounting and clock offset, biases and axes of the IMU, errors of each beam, scenario.
void write_truth(const std::string& path, const Scenario& scenario, std::uint64_t seed,
                 std::optional<double> tunnel_begin_x_m, const LidarErrors& errors, const ImuAxes& axes,
                 const ImuReading& first, const ImuReading& last);

/// Parameters of fdi_lio for this recording: what a user would know from data sheets and drawings.
void write_system_config(const std::string& path, const Scenario& scenario, const LidarModel& model);

}  // namespace fdi_lio::simulation
