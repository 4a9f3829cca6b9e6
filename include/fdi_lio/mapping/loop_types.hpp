#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// What became of a loop candidate.
enum class LoopVerdict {
  kAccepted,
  kLowOverlap,          ///< too little of the scan lies where the map has something
  kFewWalls,            ///< too few of the scan's walls are where the map has one
  kHighResidual,        ///< the matched points deviate too much
  kIntensityDisagrees,  ///< bright is where dark was
  kNoInformation,       ///< no direction is determined: nothing to add
  kFarFromPrediction,   ///< farther from the odometry's prediction than its drift allows
  kInconsistent,        ///< contradicts the loops around it
  kUnconfirmed,         ///< after much drift, no second loop came that agrees
  kPending,             ///< waits for a second loop that agrees
};

/// One word for files and messages, as `accepted` or `low_overlap`.
const char* to_text(LoopVerdict verdict);

enum class LoopSource { kDistance, kDescriptor };

const char* to_text(LoopSource source);

/// A revisit that was looked at, with how the registration went.
struct LoopCandidate {
  Stamp stamp_from = 0;
  Stamp stamp_to = 0;
  LoopSource source = LoopSource::kDistance;
  LoopVerdict verdict = LoopVerdict::kPending;
  RelativePose measured;                   ///< from the earlier keyframe to the later one
  Matrix6d covariance = Matrix6d::Zero();  ///< of `measured`; weak directions are large, not left out
  double overlap = 0.0;                    ///< share of the scan that lies near the map's surfaces
  std::size_t wall_points = 0;             ///< points of the scan on surfaces that are no ground
  double wall_share = 0.0;                 ///< of these, on walls of the map, weighted by their nearness
  double residual_m = 0.0;                 ///< root mean square of the inliers' plane distances
  double intensity_correlation = 0.0;      ///< between the scan and the map
  double surface_correlation = 1.0;        ///< the same detail by detail, only while localisation searches
  double chi_square = 0.0;                 ///< deviation from the prediction, 6 degrees of freedom
  int weak_directions = 0;                 ///< that the registration does not determine
  /// From the measured place to others that fit about as well, within the uncertainty of the prediction.
  std::vector<Eigen::Vector3d> alternatives;
};

}  // namespace fdi_lio::mapping
