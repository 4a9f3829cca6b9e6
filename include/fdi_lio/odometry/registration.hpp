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

/// What is known of the newest state of the smoother before it is aligned.
struct Expectation {
  /// Of its pose, order [dtheta (body), dt (odom)]; nothing where no IMU predicts it.
  std::optional<Matrix6d> covariance;
  /// It is not to be relied on, as at a start or after a shock: associations are sought farther away and more
  /// often.
  bool is_unreliable = false;
  /// Where the gyro is in doubt: the turn that it has missed before this scan as far as the prediction has it
  /// already, and the one that it missed before the last scan (rotation vectors, body frame). By what is
  /// missed, unless it goes on as it was, the scan was deskewed wrongly.
  std::optional<Eigen::Vector3d> missed_turn;
  Eigen::Vector3d missed_turn_before = Eigen::Vector3d::Zero();
};

/// Aligns the newest state of the smoother with the local map: associates, weighs by direction, lets the
/// smoother solve, and begins again until nothing moves. What the scans' lines say of their mean radius is
/// kept from scan to scan.
class Registration {
 public:
  Registration(const Config& config, Reporter* reporter);

  /// With fewer than `least_matches` planes and edges the scan says nothing.
  Alignment align(matching::MatchInput input, const matching::LocalMap& map, const AdaptedSettings& adapted,
                  std::size_t least_matches, const Expectation& expectation, Smoother* smoother);

 private:
  void add_shear(const Expectation& expectation, const imu::NavState& predicted, const imu::NavState& at,
                 matching::LidarInformation* information) const;
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
