#pragma once

#include <optional>

#include <Eigen/Core>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/matching/local_map.hpp"
#include "fdi_lio/matching/match_input.hpp"
#include "fdi_lio/matching/mean_radius.hpp"
#include "fdi_lio/matching/scan_matcher.hpp"
#include "fdi_lio/odometry/adaptation.hpp"
#include "fdi_lio/odometry/smoother.hpp"
#include "fdi_lio/odometry/trusted_information.hpp"

namespace fdi_lio::odometry {

/// What aligning one scan gave.
struct Alignment {
  matching::LidarInformation information;  ///< of the last iteration
  degeneracy::OptimisationStatus status;   ///< axes, localizability and iterations; the rest is the caller's
  /// Information along each of the status's axes, and what the noise alone would give [1/m^2].
  Eigen::Matrix<double, 6, 1> axis_information = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 1> axis_noise = Eigen::Matrix<double, 6, 1>::Zero();
  TrustedInformation trusted_information;
  bool is_healthy = true;  ///< false: no match was possible, or the solver failed
};

/// Aligns the newest state of the smoother with the local map: associates, weighs by direction, lets the
/// smoother solve, and begins again until nothing moves. What the scans' lines say of their mean radius is
/// kept from scan to scan.
class Registration {
 public:
  Registration(const Config& config, Reporter* reporter);

  /// `predicted_covariance`: of the newest state's pose, order [dtheta (body), dt (odom)]; nothing where no
  /// IMU predicts it. With fewer than `least_matches` planes and edges the scan says nothing.
  /// `is_unpredicted`: the prediction is not to be relied on, as at a start or after a shock, and
  /// associations are sought farther away and more often.
  Alignment align(matching::MatchInput input, const matching::LocalMap& map, const AdaptedSettings& adapted,
                  std::size_t least_matches, bool is_unpredicted,
                  const std::optional<Matrix6d>& predicted_covariance, Smoother* smoother);

 private:
  void add_directions(const matching::MatchInput& input, const matching::LocalMap& map,
                      const imu::NavState& at, const matching::MatchSettings& settings,
                      Alignment* alignment) const;
  bool has_converged(const imu::NavState& before, const imu::NavState& after) const;

  MappingConfig config_;
  Reporter* reporter_;
  matching::ScanMatcher matcher_;
  matching::MeanRadius line_radius_;
};

}  // namespace fdi_lio::odometry
