#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/odometry/bright_scan.hpp"

namespace fdi_lio::odometry {

/// The velocity of a sensor at the first of some scans.
struct BrightnessMotion {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< [m/s]
  /// By so many votes, see below, it explains the scans better than any that differs by more than 3 m/s.
  double lead = 0.0;
  bool is_known = true;          ///< it differs from what was estimated by at most 3 m/s
  double lead_over_known = 0.0;  ///< votes for it over just what was estimated
};

/// What registrations of the scans have found.
struct KnownMotion {
  Eigen::Vector3d way = Eigen::Vector3d::Zero();  ///< from the first to the last scan, level axes [m]
  /// Level unit direction along which the surfaces hardly tell the motion, as in a tunnel or between guard
  /// rails: `way` may be wrong along it, but is right across. None: it may be wrong in any direction.
  std::optional<Eigen::Vector3d> open_direction;
};

/// Looks for the velocity under which consecutive scans agree in brightness; it stays the same but for
/// `BrightScan::gained_mps`. For each velocity all points are moved to where they lie then;
/// cells of 0.5 m hold the mean of their details in each scan, and scans are compared in the cells that both
/// see. The differences d are gathered in blocks of 4 m about the sensor (a vehicle that keeps its place
/// beside the sensor is a few blocks, however many scans see it); a block says f = -ln(mean d^2 + noise) / 2.
/// One velocity beats another by the sum over the blocks of the difference, at most one a block, and less for
/// blocks that compared fewer pairs than is usual. Candidates are all level velocities up to 45 m/s, those
/// alone that agree with the surfaces where these leave one direction open, and the one that was estimated.
/// About the winner, the mean of f over all pairs says where the top of its hill is.
///
/// Unlike surfaces alone, which look the same all along a guard rail or a tunnel, and rings on the ground,
/// which travel with the sensor, what is painted stays. What stays in one direction from the sensor over all
/// the scans is taken out of the details: it would speak for rest. The velocity is known to about 0.2 m/s.
BrightnessMotion find_brightness_motion(std::vector<BrightScan> scans, const KnownMotion& known);

/// What a velocity is off by along one direction.
struct BrightnessOffset {
  double mean_mps = 0.0;
  double variance = 0.0;  ///< [(m/s)^2]
};

/// Of `velocity` at the first of consecutive scans along `axis`, a unit vector (both level axes):
/// mean and variance of an offset x with the likelihood exp(2 votes(velocity + x axis)), see above, within 3
/// m/s. Where nothing is painted all are equally likely: the mean is 0, the standard deviation 1.8 m/s.
BrightnessOffset find_brightness_offset(std::vector<BrightScan> scans, const Eigen::Vector3d& velocity,
                                        const Eigen::Vector3d& axis);

}  // namespace fdi_lio::odometry
