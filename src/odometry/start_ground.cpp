#include "fdi_lio/odometry/start_ground.hpp"

#include <cmath>
#include <vector>

#include "fdi_lio/scan/ground_plane.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr float kReachM = 20.0F;
constexpr double kMostTilt = 20.0 * M_PI / 180.0;
constexpr double kLeastShare = 0.06;  ///< of the points that are looked at
constexpr double kMostBelow = 0.2;    ///< of as many as the ground has, nothing is seen through it
constexpr double kSteep = 5.0 * M_PI / 180.0;

}  // namespace

std::optional<Eigen::Vector3d> find_ground(const FeatureSet& features, const Eigen::Matrix3d& R_odom_lidar) {
  std::vector<Eigen::Vector3f> near;
  for (const Point& point : features.planes) {
    if (point.position.norm() < kReachM) near.push_back(R_odom_lidar.cast<float>() * point.position);
  }
  const scan::Plane ground = scan::find_plane(near, Eigen::Vector3d::UnitZ(), kMostTilt);
  if (ground.share < kLeastShare || ground.below > kMostBelow * ground.share) return std::nullopt;
  return ground.normal;
}

bool is_steep(const Eigen::Vector3d& ground_normal, const Eigen::Vector3d& up) {
  return ground_normal.dot(up) < std::cos(kSteep);
}

}  // namespace fdi_lio::odometry
