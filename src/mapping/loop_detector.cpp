#include "fdi_lio/mapping/loop_detector.hpp"

#include <algorithm>

namespace fdi_lio::mapping {

namespace {

/// Places with the most similar ring keys that are compared column by column.
constexpr std::size_t kKeyCandidates = 25;
/// Proposals that are nearer along the way than this are the same revisit.
constexpr double kSameRevisitM = 10.0;

}  // namespace

void LoopDetector::add(const PlaceDescriptor& place, double path_m) {
  places_.push_back(place);
  paths_m_.push_back(path_m);
}

std::vector<LoopProposal> LoopDetector::propose(const std::vector<Eigen::Isometry3d>& poses,
                                                double sigma_m) const {
  const double newest_path_m = paths_m_.back();
  const auto end = std::upper_bound(paths_m_.begin(), paths_m_.end(), newest_path_m - config_.min_path_m);
  const auto old_enough = static_cast<std::size_t>(end - paths_m_.begin());
  const double radius_m = std::min(config_.search_radius_m + 3.0 * sigma_m, config_.max_search_radius_m);
  std::vector<LoopProposal> proposals;
  double nearest_m = radius_m;
  for (std::size_t k = 0; k < old_enough; ++k) {
    const double distance_m = (poses[k].translation() - poses.back().translation()).norm();
    if (distance_m >= nearest_m) continue;
    nearest_m = distance_m;
    proposals = {{k, LoopSource::kDistance, 0.0}};
  }
  for (const LoopProposal& proposal : by_descriptor(poses, radius_m, old_enough)) {
    const bool is_known = std::any_of(proposals.begin(), proposals.end(), [&](const LoopProposal& other) {
      return std::abs(paths_m_[other.from] - paths_m_[proposal.from]) < kSameRevisitM;
    });
    if (!is_known) proposals.push_back(proposal);
  }
  return proposals;
}

std::vector<LoopProposal> LoopDetector::by_descriptor(const std::vector<Eigen::Isometry3d>& poses,
                                                      double radius_m, std::size_t old_enough) const {
  std::vector<std::size_t> near;
  for (std::size_t k = 0; k < old_enough; ++k)
    if ((poses[k].translation() - poses.back().translation()).norm() <= radius_m) near.push_back(k);
  AlikeSearch search;
  search.max_distance = config_.descriptor_max_distance;
  search.limit = static_cast<std::size_t>(config_.descriptor_candidates);
  search.key_candidates = kKeyCandidates;
  search.is_same = [this](std::size_t a, std::size_t b) {
    return std::abs(paths_m_[a] - paths_m_[b]) < kSameRevisitM;
  };
  std::vector<LoopProposal> proposals;
  for (const AlikePlace& place : most_alike(places_, near, places_.back(), search))
    proposals.push_back({place.index, LoopSource::kDescriptor, place.match.yaw_rad});
  return proposals;
}

}  // namespace fdi_lio::mapping
