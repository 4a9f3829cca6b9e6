#pragma once

#include <optional>
#include <string>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"
#include "fdi_lio/degeneracy/environment_classifier.hpp"
#include "fdi_lio/degeneracy/information_weights.hpp"
#include "fdi_lio/degeneracy/voxel_statistics.hpp"

namespace fdi_lio::degeneracy {

/// What mapping found about the directions of one scan.
struct OptimisationStatus {
  Stamp stamp = 0;
  Eigen::Matrix<double, 6, 6> axes = Eigen::Matrix<double, 6, 6>::Identity();
  Eigen::Matrix<double, 6, 1> localizability = Eigen::Matrix<double, 6, 1>::Ones();
  double position_sigma_m = 0.0;  ///< `weakest_position_sigma_m` of the pose; 0: unknown
  double residual_rms_m = 0.0;
  std::uint32_t iterations = 0;
  std::uint32_t matched = 0;
};

/// Standard deviation of the position along its least known direction: root of the largest eigenvalue of the
/// lower right block of a pose covariance in the order [rotation, translation]; 0 where that is not finite.
double weakest_position_sigma_m(const Eigen::Matrix<double, 6, 6>& covariance);

/// The work of the degeneracy_estimation node.
class DegeneracyEstimator {
 public:
  DegeneracyEstimator(const Config& config, Reporter* reporter);

  /// Degeneracy of `scan`; `status` is that of the newest optimised scan. What became of the features of the
  /// scan before is in the status.
  Degeneracy estimate(const DeskewedScan& scan, const std::optional<OptimisationStatus>& status);

  void reset();

 private:
  Metrics measure(const DeskewedScan& scan);
  void add_knowledge(const DeskewedScan& scan, const std::optional<OptimisationStatus>& status,
                     Metrics* metrics) const;
  bool is_new(Stamp stamp);
  void copy_directions(const OptimisationStatus& status, Degeneracy* result);
  void report(const std::string& key, const std::string& text);

  Config config_;
  Reporter* reporter_;
  VoxelStatistics voxels_;
  InformationWeights weights_;
  EnvironmentClassifier classifier_;
  std::optional<Stamp> newest_stamp_;
};

}  // namespace fdi_lio::degeneracy
