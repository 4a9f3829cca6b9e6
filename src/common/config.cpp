#include "fdi_lio/common/config.hpp"

namespace fdi_lio {

Eigen::Isometry3d SensorConfig::T_imu_lidar() const {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = q_imu_lidar.toRotationMatrix();
  T.translation() = t_imu_lidar;
  return T;
}

void SensorConfig::visit(ParameterVisitor& v) {
  v.text(
      {"sensor.points_topic", "", "topic of the lidar: PointCloud2, or velodyne_msgs/VelodyneScan packets"},
      points_topic);
  v.text({"sensor.imu_topic", "", "topic of the IMU; leave empty for lidar-only"}, imu_topic);
  v.text({"sensor.gnss_topic", "", "topic of NavSatFix fixes"}, gnss_topic);
  v.text({"sensor.external_odometry_topic", "", "topic of the Odometry of wheels or cameras"},
         external_odometry_topic);
  v.choice({"sensor.deskew", "", "already_done: points of a cloud already belong to one instant"}, deskew,
           {"auto", "already_done"});
  v.choice({"sensor.stamp_at", "", "whether the header stamp is the time of the first or of the last point"},
           stamp_at, {"start", "end"});
  v.real({"sensor.scan_period", "s", "time of one revolution"}, scan_period_s, 0.01, 1.0);
  v.integer({"sensor.ring_count", "", "number of beams"}, ring_count, 1, 1024);
  v.real({"sensor.elevation_min", "deg", "elevation of the lowest beam, used when the cloud has no ring"},
         elevation_min_deg, -90.0, 90.0);
  v.real({"sensor.elevation_max", "deg", "elevation of the highest beam, used when the cloud has no ring"},
         elevation_max_deg, -90.0, 90.0);
  v.real({"sensor.min_range", "m", "nearer points are dropped (the vehicle itself)"}, min_range_m, 0.0, 20.0);
  v.real({"sensor.max_range", "m", "farther points are dropped"}, max_range_m, 1.0, 1000.0);
  v.real({"sensor.range_noise", "m", "standard deviation of one range, from the data sheet"}, range_noise_m,
         1e-4, 1.0);
  v.real({"sensor.beam_angle_noise", "deg", "standard deviation of a beam's direction"}, beam_angle_noise_deg,
         0.0, 1.0);
  v.choice({"sensor.time_source", "",
            "receive: the lidar's clock is none of the host's, scans are stamped by when they came"},
           time_source, {"header", "receive"});
  v.real({"sensor.lidar_time_offset", "s", "added to the stamps of the lidar to get the clock of the IMU"},
         lidar_time_offset_s, -10.0, 10.0);
  v.choice({"sensor.acceleration_unit", "", "unit of the accelerometer; auto decides by the first reading"},
           acceleration_unit, {"m/s^2", "g", "auto"});
  v.real({"sensor.max_acceleration", "m/s^2", "IMU readings beyond it are glitches: dropped and counted"},
         max_acceleration_mps2, 20.0, 1e5);
  v.real({"sensor.max_angular_rate", "rad/s", "IMU readings beyond it are glitches: dropped and counted"},
         max_angular_rate_radps, 1.0, 1e4);
  v.real({"sensor.gyro_noise", "rad/s/sqrt(Hz)", "white noise of the gyro"}, gyro_noise, 1e-7, 1.0);
  v.real({"sensor.accel_noise", "m/s^2/sqrt(Hz)", "white noise of the accelerometer"}, accel_noise, 1e-6,
         10.0);
  v.real({"sensor.gyro_bias_walk", "rad/s^2/sqrt(Hz)", "random walk of the gyro bias"}, gyro_bias_walk, 1e-9,
         1.0);
  v.real({"sensor.gyro_scale_sigma", "", "how well the scale of each axis of the gyro is known"},
         gyro_scale_sigma, 0.0, 0.1);
  v.real({"sensor.gyro_lean_sigma", "deg",
          "how well the axes of the gyro are known, each against each other one"},
         gyro_lean_sigma_deg, 0.0, 5.0);
  v.real({"sensor.accel_bias_walk", "m/s^3/sqrt(Hz)", "random walk of the accelerometer bias"},
         accel_bias_walk, 1e-8, 10.0);
  v.real({"sensor.accel_model_walk", "m/s^3/sqrt(Hz)",
          "added to accel_bias_walk for scale, axes, mounting, vibration and clocks"},
         accel_model_walk, 0.0, 10.0);
  v.real({"sensor.accel_bias_sigma", "m/s^2",
          "what each axis of the accelerometer may be off by at the start: its zero-g offset"},
         accel_bias_sigma_mps2, 1e-4, 5.0);
  v.real({"sensor.shock_acceleration", "m/s^2",
          "a mean acceleration between two scans that may be false altogether, in part from half of it on: "
          "readings that are clipped or come too slowly for a blow"},
         shock_acceleration_mps2, 1.0, 1e5);
  v.real({"sensor.gravity", "m/s^2", "magnitude of gravity"}, gravity_mps2, 9.7, 9.9);
  v.vector3({"sensor.T_imu_lidar.translation", "m", "p_imu = T_imu_lidar * p_lidar"}, t_imu_lidar);
  v.rotation({"sensor.T_imu_lidar.rotation", "", "quaternion x y z w, or matrix row by row"}, q_imu_lidar);
  v.real({"sensor.lidar_time_offset_sigma", "s", "how well lidar_time_offset is known"},
         lidar_time_offset_sigma_s, 0.0, 1.0);
  v.real({"sensor.mounting_sigma", "deg", "how well the rotation of T_imu_lidar is known, about each axis"},
         mounting_sigma_deg, 0.0, 10.0);
}

void FrameConfig::visit(ParameterVisitor& v) {
  v.text({"frames.map", "", "globally consistent frame"}, map);
  v.text({"frames.odom", "", "continuous frame"}, odom);
  v.text({"frames.base_link", "", "frame of the robot"}, base_link);
  v.text({"frames.imu", "", "frame of the IMU; equal to base_link unless tf knows better"}, imu);
  v.flag({"frames.publish_tf", "", "publish odom -> base_link and map -> odom"}, publish_tf);
  v.choice({"frames.extrinsics", "", "tf: the nodes look T_base_imu and T_imu_lidar up in tf (robot's URDF)"},
           extrinsics, {"parameters", "tf"});
  v.choice({"frames.sensor_tf", "",
            "publish base_link -> IMU and lidar frames: auto does when tf does not know the lidar"},
           sensor_tf, {"auto", "always", "never"});
  v.vector3({"frames.T_base_imu.translation", "m", "p_base = T_base_imu * p_imu"}, t_base_imu);
  v.rotation({"frames.T_base_imu.rotation", "", "quaternion x y z w, or matrix row by row"}, q_base_imu);
}

Eigen::Isometry3d FrameConfig::T_base_imu() const {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = q_base_imu.toRotationMatrix();
  T.translation() = t_base_imu;
  return T;
}

void ImuConfig::visit(ParameterVisitor& v) {
  v.real({"imu.static_duration", "s", "how long the sensor must stand still for static initialisation"},
         static_duration_s, 0.2, 10.0);
  v.real({"imu.static_gyro_std", "rad/s", "largest deviation of the gyro at rest"}, static_gyro_std, 1e-4,
         1.0);
  v.real({"imu.static_accel_std", "m/s^2", "largest deviation of the accelerometer at rest"},
         static_accel_std, 1e-3, 5.0);
  v.real({"imu.static_max_rate", "rad/s", "largest mean angular velocity (bias) at rest"}, static_max_rate,
         1e-3, 1.0);
  v.real({"imu.max_gap", "s", "longer stretches without a reading are bridged with inflated covariance"},
         max_gap_s, 0.001, 1.0);
  v.real({"imu.gap_accel_noise", "m/s^2/sqrt(Hz)", "accelerometer noise assumed in a gap"}, gap_accel_noise,
         0.01, 100.0);
  v.real({"imu.gap_gyro_noise", "rad/s/sqrt(Hz)", "gyro noise assumed in a gap"}, gap_gyro_noise, 0.001,
         10.0);
  v.integer({"imu.moving_init_scans", "", "scans that initialisation in motion looks at"}, moving_init_scans,
            5, 200);
  v.real({"imu.virtual_accel_noise", "m/s^2/sqrt(Hz)", "acceleration allowed by the constant-velocity model"},
         virtual_accel_noise, 0.01, 100.0);
  v.real({"imu.virtual_angular_accel_noise", "rad/s^2/sqrt(Hz)",
          "angular acceleration allowed by the constant-velocity model"},
         virtual_angular_accel_noise, 0.01, 100.0);
}

void FeatureConfig::visit(ParameterVisitor& v) {
  v.integer({"features.curvature_neighbours", "", "least number of neighbours on each side along the ring"},
            curvature_neighbours, 2, 20);
  v.real({"features.curvature_half_width", "m",
          "near the sensor the neighbours reach at least so far (at most four times as many)"},
         curvature_half_width_m, 0.0, 5.0);
  v.real({"features.plane_max_curvature", "",
          "points with a smaller curvature (0 straight, 0.71 right angle, 1 spike) can be plane features"},
         plane_max_curvature, 0.0, 1.0);
  v.real({"features.edge_min_curvature", "", "points with a larger curvature can be edge features"},
         edge_min_curvature, 0.0, 1.0);
  v.real({"features.threshold_fdi_gain", "",
          "share by which both thresholds admit more at FDI 1: fewer features are better than none"},
         threshold_fdi_gain, 0.0, 0.9);
  v.real({"features.threshold_complexity_gain", "",
          "share by which both thresholds admit less where the curvature is very uneven (leaves, clutter)"},
         threshold_complexity_gain, 0.0, 0.9);
  v.real({"features.plane_spacing", "m", "way along a ring that has one plane feature"}, plane_spacing_m,
         0.01, 5.0);
  v.integer({"features.sectors", "", "sectors of a ring that share the features equally"}, sectors, 1, 64);
  v.integer({"features.max_planes", "", "most plane features of a scan"}, max_planes, 100, 100000);
  v.integer({"features.max_edges", "", "most edge features of a scan"}, max_edges, 0, 100000);
  v.integer({"features.max_intensity", "", "most intensity features of a scan"}, max_intensity, 0, 100000);
  v.real(
      {"features.intensity_min_gradient", "",
       "points with a larger intensity gradient, in units of ln(1 + I / scale), can be intensity features"},
      intensity_min_gradient, 0.0, 10.0);
  v.real({"features.score_weight", "", "w0: weight of the intensity gradient in the composite score"},
         score_weight, 0.0, 1.0);
  v.real({"features.score_fdi_gain", "", "alpha: the weight grows by this times the FDI"}, score_fdi_gain,
         0.0, 1.0);
  v.real({"features.score_class_gain", "",
          "beta: the weight grows by this in sparse and shrinks in structured surroundings"},
         score_class_gain, 0.0, 1.0);
  v.real({"features.score_max_weight", "", "w_max: largest weight of the intensity gradient"},
         score_max_weight, 0.0, 1.0);
  v.real({"features.score_stability", "", "eta: what a stable gradient adds to the composite score"},
         score_stability, 0.0, 1.0);
  v.real({"features.occlusion_jump", "",
          "range jump between neighbours, as a share of the range, that makes an occlusion"},
         occlusion_jump_ratio, 0.001, 1.0);
  v.real({"features.min_incidence", "deg", "points that the beam grazes at a smaller angle are excluded"},
         min_incidence_deg, 0.0, 45.0);
}

void MappingConfig::visit(ParameterVisitor& v) {
  v.integer({"mapping.window_size", "", "scans in the fixed-lag smoother"}, window_size, 2, 20);
  v.integer({"mapping.base_iterations", "", "N_base: association rounds of one scan"}, base_iterations, 1,
            30);
  v.real({"mapping.feature_voxel", "m", "voxel of the feature downsampling before matching"}, feature_voxel_m,
         0.05, 5.0);
  v.integer({"mapping.max_planes_matched", "", "most plane features that are matched"}, max_planes_matched,
            100, 100000);
  v.real({"mapping.map_voxel", "m",
          "finest of the three voxel sizes of the local map; the others are twice and four times"},
         map_voxel_m, 0.05, 5.0);
  v.real({"mapping.map_radius", "m", "the local map forgets what is farther away"}, map_radius_m, 10.0,
         1000.0);
  v.integer({"mapping.plane_min_points", "", "points a voxel needs before it is used"}, plane_min_points, 4,
            100);
  v.integer({"mapping.max_points_per_voxel", "", "a voxel stops averaging after so many points"},
            max_points_per_voxel, 5, 100000);
  v.real({"mapping.plane_max_thickness", "m", "a voxel whose points deviate more is no plane or line"},
         plane_max_thickness_m, 0.005, 1.0);
  v.real({"mapping.max_residual", "m", "matches with a larger residual are rejected"}, max_residual_m, 0.01,
         10.0);
  v.real({"mapping.robust_scale", "", "Cauchy scale in standard deviations of a residual"}, robust_scale, 0.1,
         100.0);
  v.real({"mapping.max_deviation", "",
          "after the first round, matches that deviate by more standard deviations are rejected"},
         max_deviation, 1.0, 1e9);
  v.real({"mapping.surface_roughness", "m", "deviation of real surfaces from the map's planes"},
         surface_roughness_m, 0.0, 0.5);
  v.real(
      {"mapping.range_bias", "m",
       "deviation of range errors that stay as they are: surfaces differ by it between views from two sides"},
      range_bias_m, 0.0, 0.5);
  v.real({"mapping.line_radius", "m",
          "deviation of the depth of poles and trunks, of which a scan sees the near side only, and of its "
          "mean before any is seen"},
         line_radius_m, 0.0, 1.0);
  v.real({"mapping.correlation_factor", "",
          "how many residuals share one independent error (map, beam calibration)"},
         correlation_factor, 1.0, 1000.0);
  v.real({"mapping.shared_elevation_error", "deg",
          "deviation of the error of elevation that planes of one direction within 10 m share (0: none)"},
         shared_elevation_error_deg, 0.0, 1.0);
  v.real({"mapping.shared_range_error", "m",
          "deviation of the error of range that planes of one direction within 10 m share (0: none)"},
         shared_range_error_m, 0.0, 1.0);
  v.real({"mapping.convergence_rotation", "rad", "iterations stop below this step"}, convergence_rotation_rad,
         0.0, 0.1);
  v.real({"mapping.convergence_translation", "m", "iterations stop below this step"},
         convergence_translation_m, 0.0, 1.0);
  v.real({"mapping.keyframe_distance", "m", "tau_0: motion that makes a keyframe"}, keyframe_distance_m, 0.01,
         100.0);
  v.real({"mapping.keyframe_rotation_weight", "m/rad", "lambda: metres that one radian counts"},
         keyframe_rotation_weight_m_per_rad, 0.0, 100.0);
  v.real({"mapping.output_map_voxel", "m", "voxel of the map that is saved"}, output_map_voxel_m, 0.01, 5.0);
  v.flag({"mapping.use_edges", "", "match edge features to lines of the map"}, use_edges);
  v.flag({"mapping.use_intensity", "", "match intensity features to the intensities of the map"},
         use_intensity);
  v.real({"mapping.intensity_weight", "", "factor on the information of intensity matches"}, intensity_weight,
         0.0, 100.0);
  v.real({"mapping.intensity_voxel", "m", "finest voxel of the intensity map"}, intensity_voxel_m, 0.05, 2.0);
  v.flag({"mapping.judge_patches", "",
          "trust patches of planes less that contradict the predicted pose: traffic"},
         judge_patches);
  v.flag({"mapping.soften_weak_directions", "",
          "leave weak directions to the IMU in scans without intensity features"},
         soften_weak_directions);
  v.flag({"mapping.watch_velocity", "",
          "ask the brightness of the road for the velocity where surfaces do not hold it"},
         watch_velocity);
  v.real({"mapping.localizability_margin", "",
          "factor on the information that noise alone gives, which a direction must exceed to count as "
          "observed"},
         localizability_margin, 0.0, 1000.0);
  v.real(
      {"mapping.covariance_factor", "",
       "factor on the stated covariance: scans share errors (map, surfaces, beams) that do not average out"},
      covariance_factor, 0.0, 1e6);
  v.real({"mapping.drift_share", "",
          "factor on the share of a pose's covariance that stays in the map for each feature radius of way"},
         drift_share, 0.0, 1000.0);
  v.flag({"mapping.estimate_mounting", "",
          "estimate the error of the rotation of T_imu_lidar, with sensor.mounting_sigma as what is known"},
         estimate_mounting);
  v.flag({"mapping.estimate_time_offset", "",
          "estimate what is left of the offset of the clocks, with sensor.lidar_time_offset_sigma as what is "
          "known"},
         estimate_time_offset);
  v.flag({"mapping.estimate_gyro_scale", "",
          "estimate scales and axes of the gyro, with sensor.gyro_scale_sigma and sensor.gyro_lean_sigma as "
          "what is known"},
         estimate_gyro_scale);
  v.real({"mapping.tilt_walk", "deg/sqrt(m)",
          "random walk of the tilt of the local map against gravity: errors of the beams turn it on the way"},
         tilt_walk_deg, 0.0, 10.0);
  v.flag({"mapping.calibrate_beams", "", "learn the systematic errors of each beam against the map"},
         calibrate_beams);
  v.real({"mapping.beam_range_sigma", "m", "expected deviation of the beams' range errors"},
         beam_range_sigma_m, 1e-4, 1.0);
  v.real(
      {"mapping.beam_elevation_sigma", "deg",
       "expected deviation of the beams' elevation errors; what is smooth of them from beam to beam stays"},
      beam_elevation_sigma_deg, 1e-4, 1.0);
  v.real({"mapping.common_elevation_sigma", "deg",
          "expected error of elevation that all of 16 beams share, sqrt(16/n) of it for n; gravity shows it "
          "(0: taken as none)"},
         common_elevation_sigma_deg, 0.0, 2.0);
  v.real({"mapping.plane_weight", "", "factor on the information of plane matches"}, plane_weight, 0.0,
         100.0);
  v.real({"mapping.edge_weight", "",
          "factor on the information of edge matches: silhouettes move with the viewpoint"},
         edge_weight, 0.0, 100.0);
  v.real({"mapping.line_max_thickness", "m", "a voxel of edges whose points deviate more is no line"},
         line_max_thickness_m, 0.005, 1.0);
}

void NodeConfig::visit(ParameterVisitor& v) {
  v.real({"nodes.answer_timeout", "s", "how long a node waits for what another says of the same scan"},
         answer_timeout_s, 0.0, 10.0);
  v.integer({"nodes.scan_queue", "", "scans that may wait before the oldest are dropped and counted"},
            scan_queue, 1, 100000);
  v.real({"nodes.local_map_period", "s", "time between two messages of map/local"}, local_map_period_s, 0.1,
         3600.0);
  v.real({"nodes.global_map_period", "s", "time between two messages of map/global"}, global_map_period_s,
         0.1, 3600.0);
  v.real({"nodes.global_map_voxel", "m", "voxel of map/global, which is for looking at"}, global_map_voxel_m,
         0.02, 10.0);
  v.integer({"nodes.path_poses", "", "poses in the path message; beyond that every second one is dropped"},
            path_poses, 10, 1000000);
  v.real({"nodes.correction_time_constant", "s",
          "map -> odom follows a new correction with this time constant; 0: at once"},
         correction_time_constant_s, 0.0, 600.0);
}

void CheckConfig::visit(ParameterVisitor& v) {
  v.flag({"check.enabled", "", "compare the first seconds of the data with the parameters before the start"},
         enabled);
  v.real({"check.duration", "s", "how much of the recording is looked at"}, duration_s, 0.5, 60.0);
  v.real({"check.gravity_tolerance", "m/s^2",
          "how far the mean |acceleration| may be from sensor.gravity without a warning"},
         gravity_tolerance_mps2, 0.01, 10.0);
  v.real({"check.max_extrinsic_angle", "deg",
          "how far the ground may be tilted against gravity without a warning"},
         max_extrinsic_angle_deg, 1.0, 44.0);
  v.real({"check.min_imu_rate", "Hz", "slower IMUs get a warning"}, min_imu_rate_hz, 1.0, 10000.0);
  v.real({"check.max_imu_rate", "Hz", "faster IMUs get a warning"}, max_imu_rate_hz, 1.0, 10000.0);
  v.real({"check.max_angular_rate", "rad/s", "a larger median angular velocity is taken for deg/s"},
         max_angular_rate_radps, 0.1, 100.0);
  v.real({"check.period_tolerance", "",
          "share of sensor.scan_period that the time between scans may deviate without a warning"},
         period_tolerance, 0.001, 1.0);
  v.real({"check.min_overlap", "", "share of the scans' time that the IMU must cover without a warning"},
         min_overlap, 0.0, 1.0);
}

void Config::visit(ParameterVisitor& v) {
  sensor.visit(v);
  frames.visit(v);
  imu.visit(v);
  intensity.visit(v);
  gradient.visit(v);
  isolation.visit(v);
  dynamic.visit(v);
  features.visit(v);
  mapping.visit(v);
  degeneracy.visit(v);
  adaptation.visit(v);
  loop.visit(v);
  gnss.visit(v);
  external_odometry.visit(v);
  localisation.visit(v);
  nodes.visit(v);
  check.visit(v);
  v.integer({"threads", "", "threads of one process; the result does not depend on it"}, threads, 1, 64);
}

}  // namespace fdi_lio
