#include "fdi_lio/odometry/start_motion.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace fdi_lio::odometry {

namespace {

constexpr double kCellM = 0.25;
constexpr double kReachM = 60.0;   ///< level distance of the points that are used
constexpr double kHeightM = 10.0;  ///< up and down
constexpr std::size_t kMaxPoints = 2000;
constexpr double kHitShare = 0.7;  ///< of the points at the true displacement
constexpr double kMaxShare = 0.5;  ///< of the displacements at which a point may find a neighbour
constexpr double kMaxSpeed = 45.0;
constexpr double kMaxInterval = 0.25;  ///< between the two scans [s]: beyond, one velocity does not do
/// By so much of the best score the predicted motion must be worse. At true starts from 2.5 to 18 m/s it is
/// by 0.2 and more; where the way is not seen (tunnels), wrong ones exceed it by up to 0.08.
constexpr double kMinAdvantage = 0.2;
/// And by so much at least: of what shows nothing, chance prefers some displacement by some tens.
constexpr double kMinDifference = 100.0;
/// Where the IMU hardly feels anything, a sensor that stands is the alternative. Then the scans are alike: of
/// 124 at rest the best displacement was never farther off than the next cell, and better by 0.055 at most.
constexpr double kMinCalmAdvantage = 0.05;
constexpr double kLeastCalmStep = 2.0 * kCellM;

/// Cells with a point in them or next to them.
class Occupancy {
 public:
  explicit Occupancy(const std::vector<Eigen::Vector3d>& points) : cells_(kSide * kSide * kLevels, 0) {
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3i middle = cell(point);
      for (int x = -1; x <= 1; ++x) {
        for (int y = -1; y <= 1; ++y) {
          for (int z = -1; z <= 1; ++z) {
            const Eigen::Vector3i at = middle + Eigen::Vector3i(x, y, z);
            if (is_inside(at)) cells_[index(at)] = 1;
          }
        }
      }
    }
  }

  bool is_near(const Eigen::Vector3d& point) const {
    const Eigen::Vector3i at = cell(point);
    return is_inside(at) && cells_[index(at)] != 0;
  }

 private:
  static constexpr std::size_t kSide = static_cast<std::size_t>(2.0 * kReachM / kCellM);
  static constexpr std::size_t kLevels = static_cast<std::size_t>(2.0 * kHeightM / kCellM);

  static Eigen::Vector3i cell(const Eigen::Vector3d& point) {
    const Eigen::Vector3d corner(-kReachM, -kReachM, -kHeightM);
    return ((point - corner) / kCellM).array().floor().cast<int>();
  }
  static bool is_inside(const Eigen::Vector3i& at) {
    return (at.array() >= 0).all() && at.x() < static_cast<int>(kSide) && at.y() < static_cast<int>(kSide) &&
           at.z() < static_cast<int>(kLevels);
  }
  static std::size_t index(const Eigen::Vector3i& at) {
    return (static_cast<std::size_t>(at.z()) * kSide + static_cast<std::size_t>(at.y())) * kSide +
           static_cast<std::size_t>(at.x());
  }

  std::vector<std::uint8_t> cells_;
};

std::vector<Eigen::Vector3d> level_displacements(double max_distance_m) {
  std::vector<Eigen::Vector3d> result;
  const int steps = static_cast<int>(max_distance_m / kCellM);
  for (int x = -steps; x <= steps; ++x) {
    for (int y = -steps; y <= steps; ++y) {
      const Eigen::Vector3d displacement(x * kCellM, y * kCellM, 0.0);
      if (displacement.norm() <= max_distance_m) result.push_back(displacement);
    }
  }
  return result;
}

/// The points about the IMU, in the axes of `odom`.
std::vector<Eigen::Vector3d> turned(const FeatureSet& features, const Eigen::Isometry3d& T_turned_lidar) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(features.planes.size() + features.edges.size());
  for (const std::vector<Point>* list : {&features.planes, &features.edges}) {
    for (const Point& point : *list) points.push_back(T_turned_lidar * point.position.cast<double>());
  }
  return points;
}

}  // namespace

StartMotion find_start_motion(const std::vector<Eigen::Vector3d>& before,
                              const std::vector<Eigen::Vector3d>& now, const Eigen::Vector3d& predicted,
                              double max_distance_m) {
  const Occupancy occupancy(before);
  std::vector<Eigen::Vector3d> displacements = level_displacements(max_distance_m);
  displacements.push_back(predicted);
  std::vector<double> scores(displacements.size(), 0.0);
  std::vector<std::uint8_t> hits(displacements.size());
  const std::size_t count = std::min(now.size(), kMaxPoints);
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d& point = now[k * now.size() / count];
    if (point.head<2>().norm() > kReachM - max_distance_m) continue;
    std::size_t found = 0;
    for (std::size_t c = 0; c < displacements.size(); ++c) {
      hits[c] = occupancy.is_near(point + displacements[c]) ? 1 : 0;
      found += hits[c];
    }
    const double share =
        (static_cast<double>(found) + 1.0) / (static_cast<double>(displacements.size()) + 2.0);
    if (share >= kMaxShare) continue;
    const double hit = std::log(kHitShare / share);
    const double miss = std::log((1.0 - kHitShare) / (1.0 - share));
    for (std::size_t c = 0; c < displacements.size(); ++c) scores[c] += hits[c] != 0 ? hit : miss;
  }
  const auto best = static_cast<std::size_t>(std::max_element(scores.begin(), scores.end()) - scores.begin());
  return {displacements[best], scores[best], scores.back()};
}

std::optional<StartMotion> find_start_motion(const FeatureSet& first,
                                             const Eigen::Quaterniond& q_odom_imu_first,
                                             const FeatureSet& second,
                                             const Eigen::Quaterniond& q_odom_imu_second,
                                             const Eigen::Isometry3d& T_imu_lidar,
                                             const Eigen::Vector3d& predicted) {
  const double dt = seconds_between(first.stamp, second.stamp);
  if (dt <= 0.0 || dt > kMaxInterval) return std::nullopt;
  return find_start_motion(turned(first, q_odom_imu_first * T_imu_lidar),
                           turned(second, q_odom_imu_second * T_imu_lidar), predicted, kMaxSpeed * dt);
}

std::optional<StartVelocity> start_velocity(const FeatureSet& first, const imu::NavState& first_state,
                                            const FeatureSet& second, const imu::NavState& predicted,
                                            bool is_calm, const Eigen::Isometry3d& T_imu_lidar) {
  const Eigen::Vector3d step = predicted.t_odom_imu - first_state.t_odom_imu;
  const auto motion =
      find_start_motion(first, first_state.q_odom_imu, second, predicted.q_odom_imu, T_imu_lidar, step);
  if (!motion) return std::nullopt;
  const double difference = motion->score - motion->score_predicted;
  if (difference < kMinDifference) return std::nullopt;
  const bool is_clear = difference >= kMinAdvantage * motion->score;
  const bool is_no_rest = is_calm && (motion->displacement - step).norm() >= kLeastCalmStep &&
                          difference >= kMinCalmAdvantage * motion->score;
  if (!is_clear && !is_no_rest) return std::nullopt;
  return StartVelocity{motion->displacement / seconds_between(first.stamp, second.stamp), is_clear};
}

FeatureSet moved_while_scanned(FeatureSet features, const imu::NavState& state,
                               const Eigen::Isometry3d& T_imu_lidar) {
  const Eigen::Matrix3d R_lidar_odom = (state.q_odom_imu * T_imu_lidar).linear().transpose();
  const Eigen::Vector3f v_lidar = (R_lidar_odom * state.v_odom).cast<float>();
  for (std::vector<Point>* points : {&features.planes, &features.edges, &features.intensity_edges}) {
    for (Point& point : *points) point.position += v_lidar * point.time_s;
  }
  return features;
}

}  // namespace fdi_lio::odometry
