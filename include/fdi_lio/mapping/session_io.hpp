#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"

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
};

/// Saves the session to a new folder `path`: session.yaml (format, version, and size and checksum of every
/// file), graph.g2o, trajectory.tum (corrected) and odometry.tum of the keyframes, trajectory_kitti.txt,
/// map.pcd, keyframes/NNNNNN.pcd (x y z intensity layer; layer 0 surface, 1 planes, 2 edges). All is written
/// to `path`.part, flushed to the disk and renamed, so that `path` is whole or not there. Throws Error when
/// `path` exists (nothing that exists is ever removed, but for a `path`.part that a crash left), or when the
/// disk takes no more (the unfinished folder is then removed).
void save_session(const GlobalOptimizer& global, double map_voxel_m, const std::string& path);

/// `path`, or the first of path_2, path_3, ... that does not exist.
std::string free_session_path(const std::string& path);

/// Reads and checks a session: every file that session.yaml lists must be there with its size and checksum.
/// Throws Error with the file that is missing, changed or foreign.
Session load_session(const std::string& path);

/// The cloud of one keyframe of a session. Throws Error when its file is not as it should be.
KeyframeCloud load_session_cloud(const Session& session, std::size_t keyframe);

}  // namespace fdi_lio::mapping
