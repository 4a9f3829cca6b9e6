#pragma once

#include <fstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::evaluation {

struct StampedPose {
  Stamp stamp = 0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
};

enum class TrajectoryFormat {
  kTum,    ///< `stamp tx ty tz qx qy qz qw`
  kKitti,  ///< the upper 3x4 of the matrix, row by row, without stamps
};

/// `tum` or `kitti`. Throws Error for anything else.
TrajectoryFormat to_trajectory_format(const std::string& text);

/// Writes all poses. Throws Error when the file cannot be written.
void write_trajectory(const std::string& path, const std::vector<StampedPose>& poses,
                      TrajectoryFormat format);

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
