#pragma once

#include <fstream>
#include <string>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::evaluation {

/// Writes a trajectory in the TUM format line by line, so that a run that is cut short keeps what it has.
class TrajectoryWriter {
 public:
  /// Throws Error when the file cannot be made.
  explicit TrajectoryWriter(const std::string& path);

  /// One line `stamp tx ty tz qx qy qz qw`, stamp in seconds with nanoseconds. Throws Error when the disk is
  /// full.
  void add(Stamp stamp, const Eigen::Quaterniond& q, const Eigen::Vector3d& t);

 private:
  std::string path_;
  std::ofstream out_;
};

}  // namespace fdi_lio::evaluation
