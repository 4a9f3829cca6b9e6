#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/mapping/keyframe_store.hpp"
#include "fdi_lio/mapping/loop_types.hpp"
#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::mapping {

/// Where a registration starts, and how far off that may be.
struct RegistrationStart {
  Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
  double sigma_translation_m = 0.0;
  double sigma_rotation_rad = 0.0;
};

/// Registers keyframes against a submap of earlier ones and says what is known afterwards.
class LoopVerifier {
 public:
  explicit LoopVerifier(const Config& config);

  /// `target`: keyframes about the earlier one, in its IMU frame. `source`: the later keyframe and some
  /// before it, in the later one's IMU frame. Fills everything of the candidate but its stamps and source;
  /// the verdict is kPending when nothing speaks against the loop.
  LoopCandidate verify(const std::vector<PlacedCloud>& target, const std::vector<PlacedCloud>& source,
                       const RegistrationStart& start) const;

  /// The same for a keyframe and those just before it (`target`, in the frame of the last of them): from
  /// `T_start` alone, which is off by a fraction of a metre at most. The information is that of the points
  /// alone. Nothing when a test of a loop speaks against the result.
  std::optional<RelativePose> register_step(const std::vector<PlacedCloud>& target,
                                            const std::vector<PlacedCloud>& source,
                                            const Eigen::Isometry3d& T_start) const;

 private:
  struct Scene;
  struct Solution;

  std::optional<Solution> refine(const Scene& scene, const Eigen::Isometry3d& T_start,
                                 const RegistrationStart& start, const std::vector<Solution>& found) const;
  Scene make_scene(const std::vector<PlacedCloud>& target, const std::vector<PlacedCloud>& source) const;
  double wall_score(const Scene& scene, const Eigen::Isometry3d& T, std::size_t limit,
                    double distance_m) const;
  std::vector<Eigen::Isometry3d> search(const Scene& scene, const RegistrationStart& start) const;
  void measure(const Scene& scene, const Eigen::Isometry3d& T, LoopCandidate* candidate) const;
  Matrix6d covariance_of(const Solution& solution, LoopCandidate* candidate) const;
  void set_information(const Solution& best, const std::vector<Eigen::Vector3d>& alternatives,
                       LoopCandidate* candidate) const;
  LoopVerdict judge(const LoopCandidate& candidate) const;

  LoopConfig config_;
  matching::VoxelMapConfig plane_map_config_;
  matching::VoxelMapConfig edge_map_config_;
  matching::ScanMatcher matcher_;
};

}  // namespace fdi_lio::mapping
