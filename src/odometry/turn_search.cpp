#include "fdi_lio/odometry/turn_search.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/matching/match_input.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr double kMostTurn = 45.0 * kDegree;
/// First in large steps, then about the best of those.
constexpr double kCoarseStep = 6.0 * kDegree;
constexpr std::size_t kCoarsePoints = 200;
constexpr std::size_t kRefined = 2;
constexpr double kFineStep = 1.5 * kDegree;
constexpr std::size_t kFinePoints = 500;
/// A point lies on a plane that is nearer than what it moves by on a step, or than this [m].
constexpr double kLeastDistance = 0.05;
/// Of the points at the true turn, and of the turns at which a point may find a plane.
constexpr double kHitShare = 0.7;
constexpr double kMaxShare = 0.5;
/// A share of the best score, and what chance may prefer.
constexpr double kMinAdvantage = 0.02;
constexpr double kMinDifference = 20.0;

using Turns = std::vector<Eigen::Vector3d>;

/// Rotation vectors about `center`, in steps along each axis, within `most` of it.
void add_turns(const Eigen::Vector3d& center, double most, double step, Turns* turns) {
  const int count = static_cast<int>(std::floor(most / step));
  for (int x = -count; x <= count; ++x) {
    for (int y = -count; y <= count; ++y) {
      for (int z = -count; z <= count; ++z) {
        const Eigen::Vector3d turn = step * Eigen::Vector3d(x, y, z);
        if (turn.norm() <= most) turns->push_back(center + turn);
      }
    }
  }
}

/// Whether each point (in the columns) finds its plane after each turn.
class Hits {
 public:
  Hits(const matching::VoxelMap& map, const std::vector<Eigen::Vector3d>& points,
       const Eigen::Isometry3d& T_map_imu, const Turns& turns, double step)
      : points_(points.size()), turns_(turns.size()), hits_(points.size() * turns.size(), 0) {
    std::vector<Eigen::Vector3d> moved(points_);
    std::vector<const matching::Cell*> cells(points_);
    for (std::size_t c = 0; c < turns_; ++c) {
      const Eigen::Isometry3d T = T_map_imu * so3::exp_q(turns[c]);
      for (std::size_t k = 0; k < points_; ++k) moved[k] = T * points[k];
      map.find_planes(moved.data(), points_, false, cells.data());
      for (std::size_t k = 0; k < points_; ++k) {
        if (!cells[k]) continue;
        const double distance = std::abs(cells[k]->axes.col(0).dot(moved[k] - cells[k]->mean));
        hits_[c * points_ + k] = distance <= std::max(kLeastDistance, 0.6 * step * points[k].norm()) ? 1 : 0;
      }
    }
  }

  std::vector<double> scores() const {
    std::vector<double> scores(turns_, 0.0);
    for (std::size_t k = 0; k < points_; ++k) {
      std::size_t found = 0;
      for (std::size_t c = 0; c < turns_; ++c) found += hits_[c * points_ + k];
      const double share = (static_cast<double>(found) + 1.0) / (static_cast<double>(turns_) + 2.0);
      if (share >= kMaxShare) continue;
      const double hit = std::log(kHitShare / share);
      const double miss = std::log((1.0 - kHitShare) / (1.0 - share));
      for (std::size_t c = 0; c < turns_; ++c) scores[c] += hits_[c * points_ + k] != 0 ? hit : miss;
    }
    return scores;
  }

 private:
  std::size_t points_;
  std::size_t turns_;
  std::vector<std::uint8_t> hits_;
};

}  // namespace

std::optional<Eigen::Vector3d> find_turn(const matching::VoxelMap& map,
                                         const std::vector<Eigen::Vector3d>& planes,
                                         const Eigen::Isometry3d& T_map_imu) {
  Turns coarse;
  add_turns(Eigen::Vector3d::Zero(), kMostTurn, kCoarseStep, &coarse);
  const std::vector<double> coarse_scores =
      Hits(map, matching::thin_out(planes, kCoarsePoints), T_map_imu, coarse, kCoarseStep).scores();
  std::vector<std::size_t> order(coarse.size());
  std::iota(order.begin(), order.end(), 0);
  std::partial_sort(order.begin(), order.begin() + kRefined, order.end(),
                    [&](std::size_t a, std::size_t b) { return coarse_scores[a] > coarse_scores[b]; });
  Turns fine;
  for (std::size_t k = 0; k < kRefined; ++k) add_turns(coarse[order[k]], kCoarseStep, kFineStep, &fine);
  fine.emplace_back(Eigen::Vector3d::Zero());
  const std::vector<double> scores =
      Hits(map, matching::thin_out(planes, kFinePoints), T_map_imu, fine, kFineStep).scores();
  const auto best = std::max_element(scores.begin(), scores.end());
  const double difference = *best - scores.back();
  if (difference < kMinDifference || difference < kMinAdvantage * *best) return std::nullopt;
  return fine[static_cast<std::size_t>(best - scores.begin())];
}

FeatureSet turned_while_scanned(FeatureSet features, const Eigen::Vector3d& turn, double duration_s,
                                const Eigen::Isometry3d& T_imu_lidar) {
  const Eigen::Isometry3d T_lidar_imu = T_imu_lidar.inverse();
  for (std::vector<Point>* points : {&features.planes, &features.edges, &features.intensity_edges}) {
    for (Point& point : *points) {
      const Eigen::Quaterniond q = so3::exp_q(point.time_s / duration_s * turn);
      const Eigen::Vector3d p_imu = T_imu_lidar * point.position.cast<double>();
      point.position = (T_lidar_imu * (q * p_imu)).cast<float>();
    }
  }
  return features;
}

}  // namespace fdi_lio::odometry
