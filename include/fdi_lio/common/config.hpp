#pragma once

#include <string>

#include <Eigen/Geometry>

#include "fdi_lio/common/parameter_visitor.hpp"
#include "fdi_lio/degeneracy/degeneracy_config.hpp"
#include "fdi_lio/localisation/localisation_config.hpp"
#include "fdi_lio/mapping/global_config.hpp"
#include "fdi_lio/odometry/adaptation_config.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio {

/// What the sensors are and how they are mounted.
struct SensorConfig {
  std::string points_topic = "/points_raw";
  std::string imu_topic = "/imu_raw";
  std::string gnss_topic = "/gps/fix";
  std::string external_odometry_topic = "/wheel_odometry";
  std::string deskew = "auto";     // auto | already_done
  std::string stamp_at = "start";  // start | end, for clouds with non-negative relative times
  double scan_period_s = 0.1;
  int ring_count = 64;
  double elevation_min_deg = -24.9;
  double elevation_max_deg = 2.0;
  double min_range_m = 1.0;
  double max_range_m = 120.0;
  double range_noise_m = 0.02;
  double beam_angle_noise_deg = 0.03;
  std::string time_source = "header";
  double lidar_time_offset_s = 0.0;
  std::string acceleration_unit = "m/s^2";  // m/s^2 | g | auto
  double max_acceleration_mps2 = 500.0;
  double max_angular_rate_radps = 100.0;
  double gyro_noise = 1e-3;
  double accel_noise = 1e-2;
  double gyro_bias_walk = 1e-4;
  double gyro_scale_sigma = 0.01;
  double gyro_lean_sigma_deg = 0.2;
  double accel_bias_walk = 1e-3;
  double accel_model_walk = 1e-2;
  double accel_bias_sigma_mps2 = 0.3;
  double shock_acceleration_mps2 = 15.0;
  double gravity_mps2 = 9.81;
  Eigen::Vector3d t_imu_lidar = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_imu_lidar = Eigen::Quaterniond::Identity();
  double lidar_time_offset_sigma_s = 0.005;
  double mounting_sigma_deg = 0.2;

  Eigen::Isometry3d T_imu_lidar() const;
  void visit(ParameterVisitor& visitor);
};

/// Names of the frames that are published.
struct FrameConfig {
  std::string map = "map";
  std::string odom = "odom";
  std::string base_link = "base_link";
  std::string imu = "imu_link";
  bool publish_tf = true;
  std::string extrinsics = "parameters";  // parameters | tf
  std::string sensor_tf = "auto";         // auto | always | never
  Eigen::Vector3d t_base_imu = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q_base_imu = Eigen::Quaterniond::Identity();

  Eigen::Isometry3d T_base_imu() const;
  void visit(ParameterVisitor& visitor);
};

/// Initialisation and propagation.
struct ImuConfig {
  double static_duration_s = 1.0;
  double static_gyro_std = 0.02;
  double static_accel_std = 0.25;
  double static_max_rate = 0.1;
  double max_gap_s = 0.05;
  double gap_accel_noise = 3.0;
  double gap_gyro_noise = 0.5;
  int moving_init_scans = 20;
  double virtual_accel_noise = 1.5;
  double virtual_angular_accel_noise = 1.0;

  void visit(ParameterVisitor& visitor);
};

struct FeatureConfig {
  int curvature_neighbours = 5;
  double curvature_half_width_m = 0.3;
  double plane_max_curvature = 0.1;
  double edge_min_curvature = 0.35;
  double threshold_fdi_gain = 0.2;
  double threshold_complexity_gain = 0.2;
  double plane_spacing_m = 0.25;
  int sectors = 8;
  int max_planes = 10000;
  int max_edges = 1500;
  int max_intensity = 2000;
  double intensity_min_gradient = 0.1;
  double occlusion_jump_ratio = 0.05;
  double min_incidence_deg = 5.0;
  double score_weight = 0.3;
  double score_fdi_gain = 0.4;
  double score_class_gain = 0.1;
  double score_max_weight = 0.8;
  double score_stability = 0.1;

  void visit(ParameterVisitor& visitor);
};

struct MappingConfig {
  int window_size = 4;
  int base_iterations = 4;
  double feature_voxel_m = 0.35;
  int max_planes_matched = 10000;
  double map_voxel_m = 0.4;
  double map_radius_m = 150.0;
  int plane_min_points = 6;
  int max_points_per_voxel = 200;
  double plane_max_thickness_m = 0.1;
  double max_residual_m = 0.5;
  double robust_scale = 1.5;
  double max_deviation = 4.0;
  double surface_roughness_m = 0.01;
  double range_bias_m = 0.02;
  double line_radius_m = 0.1;
  double correlation_factor = 4.0;
  double shared_elevation_error_deg = 0.01;
  double shared_range_error_m = 0.002;
  double convergence_rotation_rad = 1e-4;
  double convergence_translation_m = 5e-4;
  double keyframe_distance_m = 1.5;
  double keyframe_rotation_weight_m_per_rad = 2.0;
  double output_map_voxel_m = 0.1;
  bool use_edges = true;
  bool use_intensity = true;
  double plane_weight = 1.0;
  double edge_weight = 0.1;
  double intensity_weight = 0.2;
  double intensity_voxel_m = 0.2;
  bool judge_patches = true;
  bool soften_weak_directions = true;
  bool watch_velocity = true;
  double localizability_margin = 1.0;
  double covariance_factor = 3.0;
  double drift_share = 1.0;
  bool estimate_mounting = true;
  bool estimate_time_offset = true;
  bool estimate_gyro_scale = true;
  double tilt_walk_deg = 0.02;
  bool calibrate_beams = true;
  double beam_range_sigma_m = 0.02;
  double beam_elevation_sigma_deg = 0.05;
  double common_elevation_sigma_deg = 0.05;
  double line_max_thickness_m = 0.05;

  void visit(ParameterVisitor& visitor);
};

/// How the nodes exchange messages.
struct NodeConfig {
  double answer_timeout_s = 0.3;
  int scan_queue = 50;
  double local_map_period_s = 2.0;
  double global_map_period_s = 5.0;
  double global_map_voxel_m = 0.4;
  int path_poses = 5000;
  double correction_time_constant_s = 1.0;

  void visit(ParameterVisitor& visitor);
};

/// The check of the first seconds of a recording (scan::DataCheck).
struct CheckConfig {
  bool enabled = true;
  double duration_s = 3.0;
  double gravity_tolerance_mps2 = 1.0;
  double max_extrinsic_angle_deg = 20.0;
  double min_imu_rate_hz = 50.0;
  double max_imu_rate_hz = 500.0;
  double max_angular_rate_radps = 6.0;
  double period_tolerance = 0.1;
  double min_overlap = 0.8;

  void visit(ParameterVisitor& visitor);
};

/// Every parameter of the system.
struct Config {
  SensorConfig sensor;
  FrameConfig frames;
  ImuConfig imu;
  scan::IntensityConfig intensity;
  scan::GradientConfig gradient;
  scan::IsolationConfig isolation;
  scan::DynamicConfig dynamic;
  FeatureConfig features;
  MappingConfig mapping;
  degeneracy::DegeneracyConfig degeneracy;
  odometry::AdaptationConfig adaptation;
  mapping::LoopConfig loop;
  mapping::GnssConfig gnss;
  mapping::ExternalOdometryConfig external_odometry;
  localisation::LocalisationConfig localisation;
  NodeConfig nodes;
  CheckConfig check;
  int threads = 2;

  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio
