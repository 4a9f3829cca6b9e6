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
  struct Scored {
    double distance;
    LoopProposal proposal;
  };
  std::vector<Scored> scored;
  for (std::size_t k = 0; k < old_enough; ++k) {
    if ((poses[k].translation() - poses.back().translation()).norm() > radius_m) continue;
    scored.push_back({ring_key_distance(places_[k], places_.back()), {k, LoopSource::kDescriptor, 0.0}});
  }
  const auto nearer = [](const Scored& a, const Scored& b) {
    return a.distance < b.distance || (a.distance == b.distance && a.proposal.from < b.proposal.from);
  };
  std::sort(scored.begin(), scored.end(), nearer);
  if (scored.size() > kKeyCandidates) scored.resize(kKeyCandidates);
  for (Scored& each : scored) {
    const PlaceMatch match = compare_places(places_[each.proposal.from], places_.back());
    each.distance = match.distance;
    each.proposal.yaw_rad = match.yaw_rad;
  }
  std::sort(scored.begin(), scored.end(), nearer);
  std::vector<LoopProposal> proposals;
  for (const Scored& each : scored) {
    if (each.distance > config_.descriptor_max_distance) break;
    if (static_cast<int>(proposals.size()) >= config_.descriptor_candidates) break;
    const bool is_known = std::any_of(proposals.begin(), proposals.end(), [&](const LoopProposal& other) {
      return std::abs(paths_m_[other.from] - paths_m_[each.proposal.from]) < kSameRevisitM;
    });
    if (!is_known) proposals.push_back(each.proposal);
  }
  return proposals;
}

}  // namespace fdi_lio::mapping
