#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/global_config.hpp"
#include "fdi_lio/mapping/loop_types.hpp"
#include "fdi_lio/mapping/place_descriptor.hpp"

namespace fdi_lio::mapping {

/// An earlier keyframe that may show the same place as the newest one.
struct LoopProposal {
  std::size_t from = 0;
  LoopSource source = LoopSource::kDistance;
  double yaw_rad = 0.0;  ///< by descriptor: of the newest level frame in that of `from`
};

/// Looks for earlier keyframes near the newest one: by the estimated poses, and by what places look like.
class LoopDetector {
 public:
  explicit LoopDetector(const LoopConfig& config) : config_(config) {}

  /// `path_m`: way of the odometry up to this keyframe.
  void add(const PlaceDescriptor& place, double path_m);

  /// Proposals for the newest keyframe. `poses`: of all keyframes in `map`. `sigma_m`: how far off the newest
  /// may be. The nearest by pose comes first, then the most alike by descriptor that lie within the largest
  /// search radius and 3 sigma.
  std::vector<LoopProposal> propose(const std::vector<Eigen::Isometry3d>& poses, double sigma_m) const;

  double path_m(std::size_t keyframe) const { return paths_m_.at(keyframe); }
  const PlaceDescriptor& place(std::size_t keyframe) const { return places_.at(keyframe); }
  std::size_t size() const { return places_.size(); }

 private:
  std::vector<LoopProposal> by_descriptor(const std::vector<Eigen::Isometry3d>& poses, double radius_m,
                                          std::size_t old_enough) const;

  LoopConfig config_;
  Places places_;
  std::vector<double> paths_m_;
};

}  // namespace fdi_lio::mapping
