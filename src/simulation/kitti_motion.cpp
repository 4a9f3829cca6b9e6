#include "fdi_lio/simulation/kitti_motion.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kPeriod = 0.1;  // seconds between KITTI's poses

PoseVector vehicle_pose(const Eigen::Matrix<double, 3, 4>& T_map_camera) {
  Eigen::Matrix3d R_vehicle_camera;  // camera: x right, y down, z forward
  R_vehicle_camera << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Eigen::Matrix3d R = R_vehicle_camera * T_map_camera.leftCols<3>() * R_vehicle_camera.transpose();
  const Eigen::Vector3d t = R_vehicle_camera * T_map_camera.col(3);
  PoseVector pose;
  pose << t, std::atan2(R(2, 1), R(2, 2)), std::asin(std::clamp(-R(2, 0), -1.0, 1.0)),
      std::atan2(R(1, 0), R(0, 0));
  return pose;
}

std::vector<PoseVector> read_poses(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw Error("cannot read the KITTI poses '" + path + "': check motion.pose_file");
  std::vector<PoseVector> poses;
  for (std::string line; std::getline(in, line);) {
    std::istringstream numbers(line);
    Eigen::Matrix<double, 3, 4> T;
    for (int i = 0; i < 12; ++i) numbers >> T(i / 4, i % 4);
    if (!numbers || !T.allFinite()) {
      throw Error(path + ":" + std::to_string(poses.size() + 1) +
                  " is not a row of 12 numbers of a KITTI pose");
    }
    poses.push_back(vehicle_pose(T));
    if (poses.size() < 2) continue;
    const double previous = poses[poses.size() - 2][5];
    poses.back()[5] = previous + std::remainder(poses.back()[5] - previous, 2.0 * M_PI);
  }
  return poses;
}

/// Beyond the ends the way is reflected at the end point, so that it keeps its speed there.
PoseVector pose_at(const std::vector<PoseVector>& poses, int index) {
  const int last = static_cast<int>(poses.size()) - 1;
  const int inside = std::clamp(index < 0 ? -index : 2 * last - index, 0, last);
  if (index < 0) return 2.0 * poses.front() - poses[static_cast<std::size_t>(inside)];
  if (index > last) return 2.0 * poses.back() - poses[static_cast<std::size_t>(inside)];
  return poses[static_cast<std::size_t>(index)];
}

std::vector<PoseVector> smoothed(const std::vector<PoseVector>& poses) {
  constexpr double kSigma = 1.5;  // poses
  constexpr int kReach = 5;
  const int last = static_cast<int>(poses.size()) - 1;
  std::vector<PoseVector> result;
  for (int i = 0; i <= last; ++i) {
    PoseVector sum = PoseVector::Zero();
    double total = 0.0;
    for (int k = -kReach; k <= kReach; ++k) {
      const double weight = std::exp(-0.5 * k * k / (kSigma * kSigma));
      sum += weight * pose_at(poses, i + k);
      total += weight;
    }
    result.push_back(sum / total);
  }
  return result;
}

}  // namespace

Trajectory load_kitti_motion(const std::string& path, double duration) {
  std::vector<PoseVector> poses = read_poses(path);
  const double available = kPeriod * (static_cast<double>(poses.size()) - 1.0);
  if (available < duration) {
    throw Error("the poses '" + path + "' last " + std::to_string(available) +
                " s, the recording was to last " + std::to_string(duration) + " s: lower the duration");
  }
  poses = smoothed(poses);
  double mean_height = 0.0;
  for (const PoseVector& pose : poses) mean_height += pose[2] / static_cast<double>(poses.size());
  for (PoseVector& pose : poses) pose[2] -= mean_height;
  return Trajectory(std::move(poses), kPeriod);
}

}  // namespace fdi_lio::simulation
