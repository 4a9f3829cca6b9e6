#pragma once

#include <cstddef>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/matching/match_input.hpp"
#include "fdi_lio/matching/voxel_map.hpp"

namespace fdi_lio::matching {

/// What a mean radius of lines that is larger by d adds to the matching cost:
///   information d^2 / 2 + gradient d + d with_pose' [dtheta, dt].
struct RadiusSums {
  double information = 0.0;  ///< [1/m^2]
  double gradient = 0.0;     ///< [1/m]
  Vector6d with_pose = Vector6d::Zero();
};

/// Second-order model of the matching cost about one pose, in the tangent [dtheta, dt] of T_odom_imu:
///   cost(d) = d' H d / 2 + b' d + constant.
struct LidarInformation {
  Eigen::Quaterniond q_odom_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d t_odom_imu = Eigen::Vector3d::Zero();
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  /// Information that errors of the map's normals and intensity gradients add to H on the average without
  /// any real constraint: sum over the residuals of their Jacobian's covariance over their variance.
  Matrix6d noise_information = Matrix6d::Zero();
  /// Of the lines whose cell was seen from about the same side as the point, |n . (v - d)| <= 0.5.
  /// MeanRadius takes it out of H and b.
  RadiusSums radius;
  double squared_error = 0.0;  ///< sum of squared plane and line distances [m^2]
  /// What the same errors, which are in the residuals too, give b on the average (errors in variables):
  /// points of a scan, which lie ahead of those that a cell knows, would be pulled back.
  Vector6d bias = Vector6d::Zero();
  double independent = 0.0;  ///< residuals, less those that share their errors with others
  Eigen::Vector3d centroid_imu = Eigen::Vector3d::Zero();  ///< of the matched features
  double radius_m = 0.0;                                   ///< their root mean square distance from it
  std::size_t planes = 0;
  std::size_t edges = 0;
  std::size_t textures = 0;
};

/// How far and how strictly matches are looked for.
struct MatchSettings {
  double max_residual_m = 0.5;
  double max_deviation = 1e9;  ///< of a residual, in its standard deviations
  bool wide = false;           ///< look into neighbouring cells too: where a pose is only roughly known
  double plane_weight = 1.0;
  double edge_weight = 1.0;
  double intensity_weight = 1.0;
  double line_radius_m = 0.0;  ///< mean radius of what lines belong to
};

/// Residuals of scan features against the local map, with noise-aware weights and a Cauchy kernel (one round
/// of iteratively re-weighted Gauss-Newton). What errors of the map's normals and intensity gradients add to
/// the normal equations is kept apart (`bias`, `noise_information`): remove_bias() takes it out.
class ScanMatcher {
 public:
  explicit ScanMatcher(const Config& config) : config_(config) {}

  /// Point to plane and point to line: associates planes and edges of `input` at the given pose and sums the
  /// normal equations. Where a cell was seen from another side than the point, the variance of the residual
  /// grows by (s n . (v - d))^2 with the mean direction v to the cell's points, that of the beam d, the
  /// residual's axis n and s = `mapping.range_bias` for planes, `mapping.line_radius` for edges. From edges
  /// MatchSettings::line_radius_m times n . (v - d) is subtracted: of round things a scan sees the near side.
  LidarInformation linearise(const MatchInput& input, const VoxelMap& plane_map, const VoxelMap& edge_map,
                             const Eigen::Quaterniond& q_odom_imu, const Eigen::Vector3d& t_odom_imu,
                             const MatchSettings& settings) const;

  /// Factor in [0, 1] on the weight of each plane of `input`, given a predicted pose and its covariance
  /// ([dtheta, dt] as in LidarInformation): its trust (`trust_planes`; 1 without `mapping.judge_patches`),
  /// taken down by the errors that it shares with its neighbours (`share_errors`). Of these, along the normal
  /// n of the map's plane,
  ///   e^2 = (s_e n . l)^2 + (s_r n . d)^2 + (s_b n . (l - l_c))^2 + (s_v n . (d - v))^2,
  ///   s_e, s_r = `mapping.shared_elevation_error`, `.shared_range_error`,
  ///   s_b, s_v = `mapping.beam_elevation_sigma`, `.range_bias`
  /// is what the calibration of the beams leaves, with the direction d of the beam and l, what a point moves
  /// by with its beam's elevation [m/rad], and with the means v and l_c of both over the points of the cell
  /// that the plane was matched with.
  std::vector<float> weigh_planes(const MatchInput& input, const VoxelMap& plane_map,
                                  const Eigen::Quaterniond& q_odom_imu, const Eigen::Vector3d& t_odom_imu,
                                  const Matrix6d& covariance) const;

  /// Intensity features: difference between the map's intensity at the point and its own,
  /// r = mean_intensity + g . (p - mean) - J, for points among those that the cell was made of: within
  /// sqrt(3) deviations of them. `squared_error` is in the unit of J.
  LidarInformation linearise_textures(const MatchInput& input, const VoxelMap& texture_map,
                                      const Eigen::Quaterniond& q_odom_imu, const Eigen::Vector3d& t_odom_imu,
                                      const MatchSettings& settings) const;

 private:
  Config config_;
};

}  // namespace fdi_lio::matching
