#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// What a g2o file holds: poses in `map` and the relative poses between them.
struct GraphFile {
  std::vector<Eigen::Isometry3d> poses;
  std::vector<RelativePose> odometry;  ///< edges between consecutive nodes
  std::vector<RelativePose> loops;     ///< all other edges
};

/// Writes VERTEX_SE3:QUAT, FIX 0 and EDGE_SE3:QUAT lines (g2o's own tangent: translation in the axes of `to`,
/// then the vector part of the quaternion). Throws Error when the file cannot be written.
void write_g2o(const std::string& path, const GraphFile& graph);

/// Reads what `write_g2o` wrote. Throws Error with the line when something else is in the file.
GraphFile read_g2o(const std::string& path);

}  // namespace fdi_lio::mapping
