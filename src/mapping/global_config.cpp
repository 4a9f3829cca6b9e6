#include "fdi_lio/mapping/global_config.hpp"

namespace fdi_lio::mapping {

namespace {

void visit_search(LoopConfig& c, ParameterVisitor& v) {
  v.flag({"loop.enabled", "", "close loops; off: the map frame is the odom frame"}, c.enabled);
  v.real({"loop.spacing", "m", "way between two searches for a loop"}, c.spacing_m, 0.1, 1000.0);
  v.real({"loop.min_path", "m", "a loop is at least so much way after the keyframe it meets"}, c.min_path_m,
         1.0, 10000.0);
  v.real({"loop.search_radius", "m", "keyframes that are so near by the estimate are candidates; drift adds"},
         c.search_radius_m, 0.1, 1000.0);
  v.real({"loop.max_search_radius", "m", "the radius grows to this at most"}, c.max_search_radius_m, 0.1,
         10000.0);
  v.real({"loop.drift_share", "",
          "standard deviation of the odometry as a share of the way since the last loop, for the search and "
          "the test against the prediction"},
         c.drift_share, 1e-4, 1.0);
  v.real({"loop.drift_rotation", "deg/m", "the same for the direction"}, c.drift_rotation_deg_per_m, 1e-5,
         1.0);
  v.integer({"loop.descriptor_candidates", "", "candidates by descriptor in each search; 0: none"},
            c.descriptor_candidates, 0, 100);
  v.real({"loop.descriptor_max_distance", "", "places that differ more are no candidates"},
         c.descriptor_max_distance, 0.0, 1.0);
  v.real({"loop.descriptor_range", "m", "radius that a descriptor sees"}, c.descriptor_range_m, 5.0, 500.0);
}

void visit_verification(LoopConfig& c, ParameterVisitor& v) {
  v.real({"loop.submap_length", "m", "way about the earlier keyframe that makes the submap"},
         c.submap_length_m, 1.0, 500.0);
  v.integer({"loop.submap_keyframes", "", "most keyframes of a submap"}, c.submap_keyframes, 1, 1000);
  v.real({"loop.source_voxel", "m", "voxel of the points that are registered"}, c.source_voxel_m, 0.05, 5.0);
  v.real({"loop.min_overlap", "", "share of the points that must lie near the submap's surfaces"},
         c.min_overlap, 0.0, 1.0);
  v.real({"loop.min_wall_share", "", "share of the scan's walls that must lie on walls of the submap"},
         c.min_wall_share, 0.0, 1.0);
  v.real({"loop.max_residual", "m", "largest root mean square of the inliers' distances"}, c.max_residual_m,
         0.001, 5.0);
  v.real({"loop.min_intensity_correlation", "", "between the points and the submap; -1: no test"},
         c.min_intensity_correlation, -1.0, 1.0);
  v.real({"loop.weak_share", "",
          "directions with a smaller share of the strongest one's information count as unknown"},
         c.weak_share, 0.0, 1.0);
  v.real({"loop.ambiguity", "",
          "another place with this share of the best one's score makes the direction to it unknown"},
         c.ambiguity, 0.0, 1.0);
  v.real({"loop.max_chi_square", "", "largest normalised deviation from prediction and other loops (6 dof)"},
         c.max_chi_square, 1.0, 1e6);
  v.real({"loop.confirm_above", "m",
          "when the odometry may have drifted more, a loop waits for a second one that agrees"},
         c.confirm_above_m, 0.0, 1e6);
}

void visit_noise(LoopConfig& c, ParameterVisitor& v) {
  v.real({"loop.sigma_translation", "m", "added to the standard deviation of every loop"},
         c.sigma_translation_m, 1e-4, 10.0);
  v.real({"loop.sigma_rotation", "deg", "added to the standard deviation of every loop"},
         c.sigma_rotation_deg, 1e-4, 10.0);
  v.real({"loop.odometry_sigma_translation", "m/sqrt(m)",
          "random walk of the odometry in the pose graph, besides its covariance"},
         c.odometry_sigma_translation, 1e-5, 1.0);
  v.real({"loop.odometry_sigma_rotation", "deg/sqrt(m)",
          "random walk of the odometry in the pose graph, besides its covariance"},
         c.odometry_sigma_rotation_deg, 1e-5, 10.0);
  v.real({"loop.gravity_sigma", "deg",
          "standard deviation of roll and pitch that gravity gives each keyframe; 0: the graph may tilt the "
          "map"},
         c.gravity_sigma_deg, 0.0, 90.0);
  v.flag({"loop.level_map", "",
          "take the tilt that gravity shows out of a map that no loop, fix or other odometry has moved"},
         c.level_map);
  v.integer({"loop.solve_every", "",
             "accepted fixes and steps of another odometry, or loops that agree with the map, between "
             "optimisations"},
            c.solve_every, 1, 10000);
  v.integer(
      {"loop.cloud_memory", "MB",
       "for the keyframes: clouds that find no room beside the graph (40 KB a keyframe) are kept on disk "
       "only"},
      c.cloud_memory_mb, 1, 1000000);
  v.flag({"loop.save_session", "", "offline_slam also writes OUTPUT/session, with all keyframe clouds"},
         c.save_session);
}

}  // namespace

void LoopConfig::visit(ParameterVisitor& v) {
  visit_search(*this, v);
  visit_verification(*this, v);
  visit_noise(*this, v);
}

void GnssConfig::visit(ParameterVisitor& v) {
  v.flag({"gnss.enabled", "", "use the fixes of sensor.gnss_topic for the corrected poses"}, enabled);
  v.vector3({"gnss.antenna", "m", "lever arm: the antenna in the IMU frame"}, p_imu_antenna);
  v.real({"gnss.min_sigma", "m", "fixes count as no better, whatever their covariance says"}, min_sigma_m,
         0.01, 100.0);
  v.real({"gnss.default_sigma", "m", "for fixes whose covariance is unknown"}, default_sigma_m, 0.01, 1000.0);
  v.real({"gnss.max_sigma", "m", "worse fixes are rejected"}, max_sigma_m, 0.1, 10000.0);
  v.real({"gnss.align_distance", "m", "extent of the fixes that the heading of the map is found from"},
         align_distance_m, 1.0, 10000.0);
  v.integer({"gnss.align_fixes", "", "least number of fixes that the heading of the map is found from"},
            align_fixes, 3, 10000);
  v.real({"gnss.align_inliers", "", "share of these fixes that must agree"}, align_inliers, 0.3, 1.0);
  v.real({"gnss.max_deviation", "",
          "fixes that deviate by more standard deviations (of fix and drift) are outliers"},
         max_deviation, 1.0, 100.0);
  v.flag({"gnss.use_altitude", "", "use the altitude too"}, use_altitude);
}

Eigen::Isometry3d ExternalOdometryConfig::T_imu_child() const {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = q_imu_child.toRotationMatrix();
  T.translation() = t_imu_child;
  return T;
}

void ExternalOdometryConfig::visit(ParameterVisitor& v) {
  v.flag({"external_odometry.enabled", "",
          "use the odometry of sensor.external_odometry_topic for the corrected poses"},
         enabled);
  v.vector3({"external_odometry.T_imu_child.translation", "m",
             "p_imu = T_imu_child * p_child; child: the frame that it follows"},
            t_imu_child);
  v.rotation({"external_odometry.T_imu_child.rotation", "", "quaternion x y z w, or matrix row by row"},
             q_imu_child);
  v.real({"external_odometry.sigma_translation", "", "standard deviation of a step, as a share of its way"},
         sigma_translation, 1e-4, 1.0);
  v.real({"external_odometry.sigma_rotation", "deg/m", "standard deviation of a step's turn, by its way"},
         sigma_rotation_deg_per_m, 1e-4, 90.0);
  v.real({"external_odometry.sigma_scale", "",
          "standard deviation of what all its ways are too long or too short by; estimated"},
         sigma_scale, 1e-6, 1.0);
  v.real({"external_odometry.max_gap", "s", "over larger gaps it says nothing"}, max_gap_s, 0.01, 60.0);
}

}  // namespace fdi_lio::mapping
