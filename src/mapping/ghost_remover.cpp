#include "fdi_lio/mapping/ghost_remover.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include "fdi_lio/common/parallel.hpp"

namespace fdi_lio::mapping {

namespace {

using scan::RangeImage;

constexpr std::size_t kReach = 24;
constexpr int kEnoughThere = 2;
constexpr int kLeastFree = 2;
constexpr int kFreeOverThere = 2;
/// Between a point, the mean of a voxel, and a beam that says that nothing is there: half a voxel.
constexpr float kMostMissM = 0.1F;
constexpr float kLeastFall = 0.01F;  ///< of a beam against the ground, in a metre: no ground is quite level
/// Of the margins of the filter, which compares points of one second: here they are means of a voxel, and the
/// odometry has drifted for up to 24 keyframes.
constexpr float kMarginFactor = 2.0F;
constexpr std::size_t kChunk = 4096;  // a multiple of RangeImage::Directions::kSize

/// How many keyframes before and after are asked in turn: most points are where all see them.
std::array<std::vector<std::size_t>, 2> steps() {
  std::array<std::vector<std::size_t>, 2> steps = {{{2, 4, 8, 16}, {}}};
  for (std::size_t step = 1; step <= kReach; ++step) {
    if (std::count(steps[0].begin(), steps[0].end(), step) == 0) steps[1].push_back(step);
  }
  return steps;
}

}  // namespace

GhostRemover::GhostRemover(const scan::DynamicConfig& config, const Eigen::Isometry3d& T_imu_lidar)
    : config_(config), T_imu_lidar_(T_imu_lidar) {}

void GhostRemover::add(const Eigen::Isometry3d& T_odom_imu, std::shared_ptr<const RangeImage> image,
                       bool is_apart) {
  const std::size_t stretch = views_.empty() ? 0 : views_.back().stretch + (is_apart ? 1 : 0);
  views_.push_back({T_odom_imu * T_imu_lidar_, std::move(image), stretch});
  for (; first_ + kReach < next_; ++first_) views_.pop_front();
}

std::optional<std::size_t> GhostRemover::next(bool is_last) {
  const std::size_t end = first_ + views_.size();
  if (next_ + (is_last ? 0 : kReach) >= end) return std::nullopt;
  return next_++;
}

std::vector<GhostRemover::Witness> GhostRemover::witnesses(std::size_t keyframe,
                                                           const std::vector<std::size_t>& steps) const {
  const View& own = views_[keyframe - first_];
  const Eigen::Isometry3d T_odom_imu = own.T_odom_lidar * T_imu_lidar_.inverse();
  std::vector<Witness> found;
  const auto call = [&](std::size_t number) {
    if (number < first_ || number >= first_ + views_.size()) return;
    const View& view = views_[number - first_];
    if (view.image && view.stretch == own.stretch)
      found.push_back({view.image.get(), (view.T_odom_lidar.inverse() * T_odom_imu).cast<float>(),
                       view.T_odom_lidar.linear().row(2).transpose().cast<float>()});
  };
  for (const std::size_t step : steps) {
    if (step <= keyframe) call(keyframe - step);
    call(keyframe + step);
  }
  return found;
}

bool GhostRemover::Witness::looks_through(const RangeImage::Directions& seen, int k, float margin_m) const {
  const int ring = seen.ring[k];
  const int column = seen.column[k];
  const float range = seen.range_m[k];
  if (!image->ring_saw_farther(ring, column, range + margin_m)) return false;
  if (image->saw_farther(ring, column, range + margin_m)) return true;
  const Eigen::Vector3f point(seen.x[k], seen.y[k], seen.z[k]);
  const Eigen::Vector3f beam = image->beam_towards(ring, column, point);
  const Eigen::Vector3f miss = range * beam - point;
  if (miss.norm() > kMostMissM) return false;
  const float above = up.dot(miss);
  const float fall = -up.dot(beam);
  if (above <= 0.0F || fall <= 0.0F) return true;
  return fall > kLeastFall &&
         image->ring_saw_farther(ring, column, range + above / (fall - kLeastFall) + margin_m);
}

void GhostRemover::ask(const std::vector<Witness>& witnesses, const std::vector<Point>& points,
                       const std::vector<std::uint32_t>& chosen, std::vector<Votes>* votes) const {
  const float margin_m = kMarginFactor * static_cast<float>(config_.free_margin_m);
  const float margin_share = kMarginFactor * static_cast<float>(config_.free_margin_share);
  parallel_chunks(chosen.size(), kChunk, [&](std::size_t begin, std::size_t end, std::size_t) {
    RangeImage::Directions seen;
    for (const Witness& witness : witnesses) {
      for (std::size_t first = begin; first < end; first += RangeImage::Directions::kSize) {
        const int size = static_cast<int>(std::min<std::size_t>(RangeImage::Directions::kSize, end - first));
        for (int k = 0; k < size; ++k)
          seen.set(k, points[chosen[first + static_cast<std::size_t>(k)]].position);
        witness.image->look_at(witness.T_lidar_imu, &seen);
        for (int k = 0; k < size; ++k) {
          if (seen.ring[k] < 0) continue;
          const float range = seen.range_m[k];
          const float margin = margin_m + margin_share * range;
          const float measured = witness.image->range_at(seen.ring[k], seen.column[k]);
          Votes& vote = (*votes)[chosen[first + static_cast<std::size_t>(k)]];
          if (measured > 0.0F && std::abs(measured - range) <= 0.5F * margin) {
            ++vote.there;
          } else if (witness.looks_through(seen, k, margin)) {
            ++vote.free;
          }
        }
      }
    }
  });
}

std::vector<Point> GhostRemover::kept(const std::vector<Point>& points, const Rounds& rounds) const {
  std::vector<Votes> votes(points.size());
  std::vector<std::uint32_t> chosen(points.size());
  std::iota(chosen.begin(), chosen.end(), 0U);
  const auto is_sure = [&votes](std::uint32_t i) {
    return votes[i].free == 0 && votes[i].there >= kEnoughThere;
  };
  for (const std::vector<Witness>& round : rounds) {
    ask(round, points, chosen, &votes);
    chosen.erase(std::remove_if(chosen.begin(), chosen.end(), is_sure), chosen.end());
  }
  std::vector<Point> result;
  result.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool goes = votes[i].free >= kLeastFree && votes[i].free > kFreeOverThere * votes[i].there;
    if (!goes) result.push_back(points[i]);
  }
  return result;
}

std::optional<KeyframeCloud> GhostRemover::clean(std::size_t keyframe, const KeyframeCloud& cloud) const {
  static const auto kSteps = steps();
  Rounds rounds;
  bool has_witness = false;
  for (std::size_t round = 0; round < rounds.size(); ++round) {
    rounds[round] = witnesses(keyframe, kSteps[round]);
    has_witness = has_witness || !rounds[round].empty();
  }
  if (!has_witness) return std::nullopt;
  KeyframeCloud cleaned = {kept(cloud.surface, rounds), kept(cloud.planes, rounds),
                           kept(cloud.edges, rounds)};
  if (cleaned.size() == cloud.size()) return std::nullopt;
  return cleaned;
}

}  // namespace fdi_lio::mapping
