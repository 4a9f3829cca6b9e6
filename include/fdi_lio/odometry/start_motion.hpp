#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::odometry {

/// How far a scan lies from the one before.
struct StartMotion {
  Eigen::Vector3d displacement = Eigen::Vector3d::Zero();  ///< [m]
  double score = 0.0;            ///< its log-likelihood, 0 for scans that show nothing
  double score_predicted = 0.0;  ///< the same of the predicted displacement
};

/// Looks for the displacement d at which the points of a scan lie on those of the one before, p_before =
/// p_now + d, among level ones up to `max_distance_m` and the predicted one. Both sets have the same axes,
/// the third upwards. A point that finds a neighbour at the share s of all displacements (ground, a wall
/// along the way: s near 1) counts if s < 0.5: log(q / s) where it finds one, log((1 - q) / (1 - s)) where it
/// does not, with q = 0.7. The best displacement is known to about 0.3 m.
StartMotion find_start_motion(const std::vector<Eigen::Vector3d>& before,
                              const std::vector<Eigen::Vector3d>& now, const Eigen::Vector3d& predicted,
                              double max_distance_m);

/// The same of two whole scans with the given attitudes of the IMU, in the axes of `odom`, at up to 45 m/s;
/// nothing when the second does not follow the first by at most 0.25 s.
std::optional<StartMotion> find_start_motion(const FeatureSet& first,
                                             const Eigen::Quaterniond& q_odom_imu_first,
                                             const FeatureSet& second,
                                             const Eigen::Quaterniond& q_odom_imu_second,
                                             const Eigen::Isometry3d& T_imu_lidar,
                                             const Eigen::Vector3d& predicted);

struct StartVelocity {
  Eigen::Vector3d v_odom = Eigen::Vector3d::Zero();  ///< [m/s]
  bool is_clear = false;  ///< much better than the prediction, and not only than rest
};

/// The velocity in `odom` at a start in motion that explains the second scan, whose pose is `predicted`, much
/// better than the prediction does; nothing when there is none, or the second comes later than 0.25 s. At
/// most 45 m/s. With an IMU that `is_calm`, as at rest, a displacement other than predicted need not be as
/// much better: a sensor that stands has none.
std::optional<StartVelocity> start_velocity(const FeatureSet& first, const imu::NavState& first_state,
                                            const FeatureSet& second, const imu::NavState& predicted,
                                            bool is_calm, const Eigen::Isometry3d& T_imu_lidar);

/// Features of a scan that was deskewed as if the sensor had only turned, deskewed with the velocity of
/// `state` (at the scan's stamp): p + v t, t the time of the point.
FeatureSet moved_while_scanned(FeatureSet features, const imu::NavState& state,
                               const Eigen::Isometry3d& T_imu_lidar);

}  // namespace fdi_lio::odometry
