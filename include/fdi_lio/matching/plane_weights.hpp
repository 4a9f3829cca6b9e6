#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::matching {

/// A plane of a scan in the map, at a predicted pose.
struct PlaneMatch {
  Eigen::Vector3d normal;        ///< of the map's plane, map frame, of either sign
  double residual_m = 0.0;       ///< distance along it
  double variance = 0.0;         ///< of the residual [m^2]
  Vector6d jacobian;             ///< of the residual, by [dtheta, dt] of T_odom_imu
  double shared_variance = 0.0;  ///< of the error in it that the neighbours have, too [m^2]
};

/// Of each plane of a scan, where the map has one.
using PlaneMatches = std::vector<std::optional<PlaneMatch>>;

/// What the prediction says about planes, for `trust_planes`.
struct TrustInput {
  Matrix6d covariance = Matrix6d::Zero();  ///< P, of the predicted pose: [dtheta, dt] of T_odom_imu
  double point_variance = 0.0;             ///< of one point along its beam [m^2]
  double correlation_factor = 1.0;         ///< residuals that count as one independent
};

/// Factor in [0, 1] on the weight of each of `planes` (body frame), in their order; 1 without a match.
///
/// What moves together with the sensor, as traffic does, looks right point by point: from scan to scan it
/// hardly deviates from where the map has it. Many points together show it. The planes are put into patches
/// (2 m cubes of the scan, by direction of the normal). Their mean residual m = sum(w r) / sum(w), w = 1 /
/// variance, with Jacobian J alike, has the expected variance
///   s^2 = correlation_factor / sum(w) + point_variance / 16 + J D P D J',  D = diag(4, 4, 4, 2, 2, 2),
/// and all planes of the patch get the trust 1 / (1 + m^2 / s^2)^2.
///
/// So much for the minority that moves. Where more than a fifth of all planes would have a trust below 1/4,
/// the prediction is suspect: the step d that the patches agree on is found by reweighted least squares,
/// sum(w) trust(m + J d) on each, and where it leaves less than half as many below 1/4, the trust is that
/// about m + J d.
std::vector<float> trust_planes(const std::vector<Eigen::Vector3d>& planes, const PlaneMatches& matches,
                                const TrustInput& input);

/// Takes the `factors` on the weights of `planes` (body frame) down by the errors that they share.
///
/// Planes of one direction that are near each other (10 m cubes) have an error e (`shared_variance`) in
/// common that no number of points averages out. With e in their mean all of them together are worth
/// sum(w) / (1 + sum(w e^2) / correlation_factor) instead of sum(w), w = factor / variance: so much less each
/// of them counts.
void share_errors(const std::vector<Eigen::Vector3d>& planes, const PlaneMatches& matches,
                  double correlation_factor, std::vector<float>* factors);

}  // namespace fdi_lio::matching
