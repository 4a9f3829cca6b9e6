#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/parameter_visitor.hpp"

namespace fdi_lio::mapping {

/// Loop closures and the pose graph. docs/global_consistency.md says how they work together.
struct LoopConfig {
  bool enabled = true;
  double spacing_m = 5.0;
  double min_path_m = 40.0;
  double search_radius_m = 6.0;
  double max_search_radius_m = 40.0;
  double drift_share = 0.01;
  double drift_rotation_deg_per_m = 0.02;
  int descriptor_candidates = 2;
  double descriptor_max_distance = 0.35;
  double descriptor_range_m = 60.0;
  double submap_length_m = 30.0;
  int submap_keyframes = 16;
  double source_voxel_m = 0.5;
  double min_overlap = 0.5;
  double min_wall_share = 0.4;
  double max_residual_m = 0.1;
  double min_intensity_correlation = 0.0;
  double weak_share = 0.01;
  double ambiguity = 0.85;
  double sigma_translation_m = 0.05;
  double sigma_rotation_deg = 0.1;
  double confirm_above_m = 2.0;
  double odometry_sigma_translation = 0.01;
  double odometry_sigma_rotation_deg = 0.03;
  double gravity_sigma_deg = 0.5;
  bool level_map = true;
  int solve_every = 10;
  double max_chi_square = 16.8;
  int cloud_memory_mb = 500;
  bool save_session = false;

  void visit(ParameterVisitor& visitor);
};

/// GNSS fixes in the pose graph.
struct GnssConfig {
  bool enabled = false;
  Eigen::Vector3d p_imu_antenna = Eigen::Vector3d::Zero();
  double min_sigma_m = 1.0;
  double default_sigma_m = 3.0;
  double max_sigma_m = 20.0;
  double align_distance_m = 40.0;
  int align_fixes = 15;
  double align_inliers = 0.7;
  double max_deviation = 3.5;
  bool use_altitude = false;

  void visit(ParameterVisitor& visitor);
};

/// Odometry of wheels or cameras in the pose graph.
struct ExternalOdometryConfig {
  bool enabled = false;
  Eigen::Vector3d t_imu_child = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_imu_child = Eigen::Quaterniond::Identity();
  double sigma_translation = 0.02;
  double sigma_rotation_deg_per_m = 0.2;
  double sigma_scale = 0.03;
  double max_gap_s = 0.5;

  Eigen::Isometry3d T_imu_child() const;
  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio::mapping
