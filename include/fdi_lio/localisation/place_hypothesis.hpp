#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/localisation/localisation_config.hpp"
#include "fdi_lio/mapping/loop_types.hpp"

/// Places in a session that may be the right one, and which of them is believed.
namespace fdi_lio::localisation {

/// Where the odometry may be in a map.
struct PlaceEstimate {
  Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_map_imu at way_m, [dtheta (body), dt (map)]
  double way_m = 0.0;                      ///< of the odometry at the last registration
};

/// How well one registration fits.
struct PlaceFit {
  double walls = 0.0;  ///< share of its walls
  double score = 0.0;  ///< `fit_of`
};

/// A place that may be the right one. Where several fit about as well, each is a hypothesis of its own.
struct PlaceHypothesis {
  PlaceEstimate estimate;
  Stamp found_at = 0;
  double found_at_m = 0.0;
  Stamp confirmed_at = 0;
  double confirmed_at_m = 0.0;
  int confirmations = 0;
  int failures = 0;            ///< in a row
  std::deque<PlaceFit> fits;   ///< of the last kFits registrations: what a place looked like farther back
                               ///< says nothing of how alike two places are here
  double known_sigma_m = 0.0;  ///< to which it must be known to be believed
  bool is_given = false;       ///< found where the user said

  static constexpr std::size_t kFits = 5;

  /// Means over `fits`; 0 without any.
  double mean_walls() const;
  double mean_score() const;

  /// Forgets the registrations so far: they were of another place.
  void begin_anew();

  /// One registration more; one that failed counts as no fit.
  void add(const mapping::LoopCandidate& candidate);
};

/// Where to look before places that look alike: the user's word, or from before the place was lost.
struct PlaceExpectation {
  Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
  double way_m = 0.0;     ///< of the odometry, when it was said
  bool is_given = false;  ///< by the user: nowhere else is looked while there is hope
  int tries = 0;          ///< searches without a hypothesis that end the hope
};

/// The newest pose of the odometry.
struct OdometryNow {
  Stamp stamp = 0;
  Eigen::Isometry3d T_odom_imu = Eigen::Isometry3d::Identity();
  double way_m = 0.0;
};

/// How well a registration fits, 0 to 1: the share of its walls times the correlation of brightness in
/// detail. A corridor's equal doors differ in what hangs beside them.
double fit_of(const mapping::LoopCandidate& candidate);

/// Largest standard deviation along any direction.
double largest_sigma(const Eigen::Matrix3d& covariance);

/// What a hypothesis has to be known to, in metres, when it was expected with `sigma_m` (0: it was not):
/// along a corridor the user's word may be all there is.
double needed_sigma_m(double expected_sigma_m);

/// What hypotheses are compared by: the mean of their fits; for those that the user's word led to,
/// exp(-(d / 4 sigma)^2 / 2) of it, d the distance to what was said.
double belief(const PlaceHypothesis& hypothesis, const std::optional<PlaceExpectation>& expectation,
              const Eigen::Isometry3d& T_odom_imu);

/// Of hypotheses that have become the same, keeps the one with the most confirmations, then the one that fits
/// best.
void join_equal(const Eigen::Isometry3d& T_odom_imu, std::vector<PlaceHypothesis>* hypotheses);

/// The hypothesis to believe: enough registrations agree over enough way or time, every direction is known,
/// and no other has `ambiguity` of its belief. When another has that share of its walls, brightness decides
/// between them. Then the agreement must be over enough way, for who stands still sees the same again, and
/// the fit `min_fit` at least, for a place that the session does not know looks a little like one or the
/// other; neither is asked of what the user's word led to. Null when there is none.
const PlaceHypothesis* believed(const std::vector<PlaceHypothesis>& hypotheses,
                                const std::optional<PlaceExpectation>& expectation, const OdometryNow& now,
                                const LocalisationConfig& config);

}  // namespace fdi_lio::localisation
