#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/cloud_file.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/mapping/place_descriptor.hpp"

namespace fdi_lio::mapping {

/// A keyframe of a saved session; its cloud stays on disk.
struct SessionKeyframe {
  Stamp stamp = 0;
  Eigen::Isometry3d T_odom_imu = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_map_imu = Eigen::Isometry3d::Identity();
};

/// A session as it was read: everything but the clouds.
struct Session {
  std::string path;
  std::vector<SessionKeyframe> keyframes;
  GraphFile graph;
  double descriptor_range_m = 0.0;  ///< that the descriptors were made with
  Places places;                    ///< of the keyframes
};

/// What a saved session has besides what is needed to go on with it.
struct SessionOptions {
  double map_voxel_m = 0.1;
  CloudFormat map_format = CloudFormat::kPcd;
  bool layers = false;  ///< also map_planes and map_edges
};

/// Saves the session to a new folder `path`: session.yaml (format, version, and size and checksum of every
/// file), graph.g2o, trajectory.tum (corrected) and odometry.tum of the keyframes, trajectory_kitti.txt,
/// map.pcd or map.ply, places.bin (descriptors), keyframes/NNNNNN.pcd (x y z intensity layer; layer 0
/// surface, 1 planes, 2 edges). All is written to `path`.part (or .part_2, ...: what a crash left stays),
/// flushed to the disk and renamed, so that `path` is whole or not there. Throws Error when `path` exists, or
/// when the disk takes no more (the unfinished folder is then removed).
void save_session(const GlobalOptimizer& global, const SessionOptions& options, const std::string& path);

/// Reads and checks a session: every file that session.yaml lists must be there with its size and checksum.
/// Throws Error with the file that is missing, changed or foreign, or when the session has no keyframes.
Session load_session(const std::string& path);

/// The cloud of one keyframe of a session. Throws Error when its file is not as it should be.
KeyframeCloud load_session_cloud(const Session& session, std::size_t keyframe);

}  // namespace fdi_lio::mapping
