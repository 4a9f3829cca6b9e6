#pragma once

#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// Orientation with zero yaw that turns the mean specific force upwards. Identity without readings.
Eigen::Quaterniond level_orientation(const ImuStatistics& statistics);

/// Whether the readings are those of a sensor at rest, be it beside a running engine: calm, and for the full
/// `static_duration_s`. A smooth drive can look the same.
bool is_static(const ImuStatistics& statistics, const ImuConfig& config);

/// Whether the readings scatter and turn as little as those of a sensor at rest: by no more than
/// `static_*_std` beyond what is white (ImuStatistics::acceleration_noise).
bool is_calm(const ImuStatistics& statistics, const ImuConfig& config);

/// Whether the readings last for `static_duration_s`, but for a tenth.
bool is_long_enough(const ImuStatistics& statistics, const ImuConfig& config);

/// One interval of initialisation in motion: lidar pose at its end, and the IMU since the pose before.
struct AlignmentInterval {
  Eigen::Quaterniond q_odom_imu;
  Eigen::Vector3d t_odom_imu;
  Preintegration imu;
};

struct AlignmentResult {
  Eigen::Vector3d gyro_bias;
  Eigen::Vector3d accel_bias;  ///< the part along gravity, by which |g| found differs from |g| known
  Eigen::Vector3d g_odom;
  Eigen::Vector3d v_first;        ///< velocity in odom at the start of the first interval
  Eigen::Vector3d v_odom;         ///< at the end of the last one
  double gravity_error_mps2 = 0;  ///< | |g| found - |g| known |, the check that the alignment is sound
  /// Standard deviation of the gravity by how far the positions scatter, along the worst axis.
  double gravity_sigma_mps2 = 0;
};

/// Gyro bias, gravity and velocity from lidar poses and preintegrated IMU. As Qin et al. ("VINS-Mono", TRO
/// 2018, section V-B), without the scale, but with the IMU's short-term accuracy used to the full: its
/// velocity changes are taken as exact, and the positions t_k scatter about
///   t_k = p_0 + v_0 T_k + g T_k^2 / 2 + S_k,   S_k the readings R dp, R dv integrated from rest,
/// which is linear least squares in p_0, v_0 and g.
/// `first` is the pose at the start of the first interval. Nothing when fewer than 5 intervals are given or
/// the system is singular.
std::optional<AlignmentResult> align_in_motion(const Eigen::Quaterniond& first_q,
                                               const Eigen::Vector3d& first_t,
                                               const std::vector<AlignmentInterval>& intervals,
                                               double gravity_mps2);

}  // namespace fdi_lio::imu
