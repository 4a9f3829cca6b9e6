#pragma once

#include <memory>
#include <optional>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/localisation/session_map.hpp"
#include "fdi_lio/mapping/keyframe.hpp"

namespace fdi_lio::localisation {

enum class LocalisationState {
  kSearching,   ///< the place is not known
  kConfirming,  ///< a place was found, later scans must agree with it
  kTracking,    ///< map -> odom is that of the session
  kLost,        ///< registrations failed in a row: the place is searched for again
};

/// One word for files and messages.
const char* to_text(LocalisationState state);

/// What one registration gave.
struct LocalisationResult {
  Stamp stamp = 0;
  LocalisationState state = LocalisationState::kSearching;
  mapping::LoopCandidate registration;     ///< of the best place that was tried
  int failures = 0;                        ///< registrations that failed in a row
  Matrix6d covariance = Matrix6d::Zero();  ///< of T_map_imu, [dtheta (body), dt (map)]
};

/// What the user says of the place: the heading is that of the IMU's x axis; height, roll and pitch follow
/// from the session and from gravity.
struct InitialPose {
  double x_m = 0.0;
  double y_m = 0.0;
  double yaw_rad = 0.0;
  double sigma_m = 2.0;
  double sigma_rad = 0.17;
};

/// Where the odometry is in a saved session, which it does not change. Finds the place by itself, from the
/// descriptors, or from an initial pose; believes it when later registrations agree by odometry and no other
/// place fits as well; then corrects map -> odom by registering the newest scans with the session.
/// Synchronous and deterministic.
class Localiser {
 public:
  /// Throws Error when a cloud of the session cannot be read.
  Localiser(const Config& config, mapping::Session session, Reporter* reporter);
  ~Localiser();

  /// Whether it is time for a registration at this pose of the odometry. Scans that are keyframes are worth
  /// adding as well: they widen what is registered.
  bool is_due(Stamp stamp, const Eigen::Isometry3d& T_odom_imu) const;

  /// Takes a scan; registers it when one is due, and says how that went.
  std::optional<LocalisationResult> add(const mapping::Keyframe& scan);

  /// The user says where the next scan will be. What was known is forgotten.
  void set_initial_pose(const InitialPose& pose);

  /// p_map = T_map_odom p_odom; nothing before the place was found for the first time.
  std::optional<Eigen::Isometry3d> T_map_odom() const;

  LocalisationState state() const;

  /// Forgets where the odometry is; the session stays.
  void reset();

  SessionMap& session();

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace fdi_lio::localisation
