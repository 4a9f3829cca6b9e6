#pragma once

#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/renewed_way.hpp"
#include "fdi_lio/odometry/gravity_estimate.hpp"

namespace fdi_lio::mapping {

/// How the map has tilted at each keyframe, by all that gravity has shown until now.
///
/// What the odometry knows of gravity at a keyframe is what came before. There gravity is confused with the
/// bias of the accelerometer and the mounting, which later turns and a longer way tell apart. So x_k = [g,
/// b_a, mounting] with the covariance P_k of keyframe k, which walk on to the next by Q_k
/// (`mapping.tilt_walk` over RenewedWay, and `sensor.accel_bias_walk`), are smoothed backwards (Rauch, Tung,
/// Striebel, AIAA Journal 1965):
///
///     x_k|N = x_k + G_k (x_k+1|N - x_k),   G_k = P_k (P_k + Q_k)^-1
///
/// That the poses between two keyframes are much better known than gravity is taken for granted.
class MapLevel {
 public:
  explicit MapLevel(const Config& config);

  /// The next keyframe, at `t_odom_imu` in `odom`; without an estimate where gravity is not known.
  void add(Stamp stamp, const Eigen::Vector3d& t_odom_imu,
           const std::optional<odometry::GravityEstimate>& gravity);

  /// For each keyframe the way down in odom (unit vectors), by all that gravity has shown until now; where
  /// nothing is known of it, that of the next keyframe that knows, else of the one before. Empty while none
  /// knows.
  std::vector<Eigen::Vector3d> down_odom() const;

  /// For each keyframe the rotation vector (odom axes [rad], without a heading) by which the map has turned
  /// since the first: g_k = Exp(tilt) g_0. Zero where nothing is known of gravity.
  std::vector<Eigen::Vector3d> tilts() const;

 private:
  struct Entry {
    Stamp stamp = 0;
    double way_m = 0.0;  ///< RenewedWay since the first keyframe
    std::optional<odometry::GravityEstimate> gravity;
  };

  void smooth(const Entry& at, const Entry& next, const Eigen::Matrix<double, 9, 1>& smoothed_next,
              Eigen::Matrix<double, 9, 1>* smoothed) const;

  double tilt_walk_mps2_;   ///< of gravity [m/s^2/sqrt(m)]
  double accel_bias_walk_;  ///< [m/s^3/sqrt(Hz)]
  RenewedWay way_;
  std::vector<Entry> entries_;
};

/// `poses` one after the other with the tilt of each taken out: a step turns by the mean of its two ends. The
/// first position stays.
std::vector<Eigen::Isometry3d> levelled_poses(const std::vector<Eigen::Isometry3d>& poses,
                                              const std::vector<Eigen::Vector3d>& tilts);

}  // namespace fdi_lio::mapping
