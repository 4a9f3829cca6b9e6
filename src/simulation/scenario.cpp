#include "fdi_lio/simulation/scenario.hpp"

namespace fdi_lio::simulation {

void WorldSettings::visit(ParameterVisitor& v) {
  v.choice(
      {"world.type", "", "kind of place"}, type,
      {"street", "tunnel", "street_tunnel", "plaza", "highway", "corridor", "mine", "forest", "handheld"});
  v.integer({"world.cars", "", "moving cars"}, cars, 0, 500);
  v.integer({"world.walkers", "", "moving people"}, walkers, 0, 500);
  v.real({"world.parked_share", "", "share of parking slots that are taken"}, parked_share, 0.0, 1.0);
  v.real({"world.trees", "", "relative density of trees"}, trees, 0.0, 5.0);
  v.real({"world.relief", "", "scale of what stands out of walls, or of roughness"}, relief, 0.0, 5.0);
  v.real({"world.texture", "", "scale of the contrast of textures"}, texture, 0.0, 3.0);
  v.real({"world.marks", "", "share of paint marks, signs and fittings that are there"}, marks, 0.0, 1.0);
  v.real({"world.length", "m", "of one straight"}, length_m, 10.0, 5000.0);
  v.real({"world.width", "m", "of a tube or corridor"}, width_m, 1.5, 60.0);
  v.real({"world.height", "m", "of a tube or corridor"}, height_m, 2.0, 30.0);
  v.real({"world.rolling", "m", "amplitude of the rolling ground"}, rolling_m, 0.0, 5.0);
  v.real({"world.dust", "1/m", "chance of a dust return per metre of ray"}, dust_per_m, 0.0, 0.2);
}

void MotionSettings::visit(ParameterVisitor& v) {
  v.choice({"motion.type", "", "who carries the sensors"}, type, {"vehicle", "handheld", "kitti"});
  v.real({"motion.speed", "m/s", "cruising speed"}, speed_mps, 0.2, 60.0);
  v.real({"motion.max_acceleration", "m/s^2", "along the way"}, max_acceleration, 0.1, 10.0);
  v.real({"motion.max_lateral_acceleration", "m/s^2", "in bends"}, max_lateral_acceleration, 0.1, 10.0);
  v.real({"motion.stand", "s", "standing still at the start"}, stand_s, 0.0, 60.0);
  v.real({"motion.start_speed", "m/s", "above 0: start in motion at this speed"}, start_speed_mps, 0.0, 60.0);
  v.real({"motion.vibration", "", "scale of roll, pitch and heave of the vehicle"}, vibration, 0.0, 10.0);
  v.real({"motion.shake", "rad/s", "peak rate of hand-held rotations"}, shake_rad_s, 0.0, 6.0);
  v.real({"motion.imu_height", "m", "above the ground"}, imu_height_m, 0.1, 10.0);
  v.text({"motion.pose_file", "", "KITTI poses for type kitti"}, pose_file);
}

void LidarSettings::visit(ParameterVisitor& v) {
  v.choice({"lidar.model", "", "sensor"}, model, {"hdl64e", "vlp16", "os1_64", "os0_128"});
  v.integer({"lidar.columns", "", "firings a revolution; 0: the model's own"}, columns, 0, 4096);
  v.real({"lidar.rate", "Hz", "revolutions a second"}, rate_hz, 1.0, 40.0);
  v.real({"lidar.max_range", "m", "0: the model's own"}, max_range_m, 0.0, 500.0);
  v.real({"lidar.range_noise", "m", "standard deviation; -1: the model's own"}, range_noise_m, -1.0, 1.0);
  v.real({"lidar.start_azimuth", "deg", "where a revolution starts"}, start_azimuth_deg, -360.0, 360.0);
  v.flag({"lidar.stamp_at_end", "", "header stamp at the last point, negative times (Velodyne)"},
         stamp_at_end);
  v.real({"lidar.latency", "s", "from the last point to the reception"}, latency_s, 0.0, 1.0);
  v.vector3({"lidar.T_imu_lidar.translation", "m", "nominal mounting"}, t_imu_lidar);
  v.rotation({"lidar.T_imu_lidar.rotation", "", "nominal mounting, x y z w"}, q_imu_lidar);
}

void ImuSettings::visit(ParameterVisitor& v) {
  v.real({"imu.rate", "Hz", "readings a second"}, rate_hz, 20.0, 1000.0);
  v.flag({"imu.nine_axis", "", "orientation is reported"}, nine_axis);
  v.real({"imu.gyro_noise", "rad/s/sqrt(Hz)", "white noise"}, gyro_noise, 0.0, 0.1);
  v.real({"imu.accel_noise", "m/s^2/sqrt(Hz)", "white noise"}, accel_noise, 0.0, 1.0);
  v.real({"imu.gyro_bias", "rad/s", "standard deviation of the initial bias"}, gyro_bias, 0.0, 1.0);
  v.real({"imu.accel_bias", "m/s^2", "standard deviation of the initial bias"}, accel_bias, 0.0, 5.0);
  v.real({"imu.gyro_bias_walk", "rad/s^2/sqrt(Hz)", "random walk"}, gyro_bias_walk, 0.0, 0.1);
  v.real({"imu.accel_bias_walk", "m/s^3/sqrt(Hz)", "random walk"}, accel_bias_walk, 0.0, 1.0);
  v.real({"imu.gravity", "m/s^2", "magnitude"}, gravity_mps2, 9.7, 9.9);
}

void ImperfectionSettings::visit(ParameterVisitor& v) {
  v.flag({"imperfections.enabled", "", "errors of real sensors that the data do not show"}, enabled);
  v.real({"imperfections.beam_elevation", "deg", "error of each beam"}, beam_elevation_deg, 0.0, 2.0);
  v.real({"imperfections.beam_azimuth", "deg", "error of each beam"}, beam_azimuth_deg, 0.0, 2.0);
  v.real({"imperfections.beam_range", "m", "error of each beam"}, beam_range_m, 0.0, 1.0);
  v.real({"imperfections.beam_gain", "", "relative intensity gain of each beam"}, beam_gain, 0.0, 1.0);
  v.real({"imperfections.range_walk", "m", "largest range error by reflectivity"}, range_walk_m, 0.0, 0.5);
  v.real({"imperfections.mixed_share", "", "share of points with mixed echoes at edges"}, mixed_share, 0.0,
         1.0);
  v.real({"imperfections.dropout", "", "share of points lost anyway"}, dropout, 0.0, 1.0);
  v.real({"imperfections.time_offset", "s", "lidar clock ahead of the IMU's"}, time_offset_s, -0.1, 0.1);
  v.real({"imperfections.extrinsic_rotation", "deg", "error of the mounting"}, extrinsic_rotation_deg, 0.0,
         10.0);
  v.real({"imperfections.extrinsic_translation", "m", "error of the mounting"}, extrinsic_translation_m, 0.0,
         1.0);
  v.real({"imperfections.gyro_scale", "", "error of the scale of each axis"}, gyro_scale, 0.0, 0.1);
  v.real({"imperfections.accel_scale", "", "error of the scale of each axis"}, accel_scale, 0.0, 0.1);
  v.real({"imperfections.imu_axes", "deg", "what each axis of the IMU leans towards each other one"},
         imu_axes_deg, 0.0, 5.0);
}

void GnssSettings::visit(ParameterVisitor& v) {
  v.flag({"gnss.enabled", "", "write fixes"}, enabled);
  v.real({"gnss.rate", "Hz", "fixes a second"}, rate_hz, 0.1, 20.0);
  v.real({"gnss.noise", "m", "white, horizontally"}, noise_m, 0.0, 100.0);
  v.real({"gnss.drift", "m", "slow error"}, drift_m, 0.0, 100.0);
  v.real({"gnss.outage_share", "", "of the time without a fix"}, outage_share, 0.0, 1.0);
  v.real({"gnss.outage_length", "s", "of one outage"}, outage_length_s, 1.0, 600.0);
  v.real({"gnss.outlier_share", "", "of the fixes"}, outlier_share, 0.0, 1.0);
  v.real({"gnss.outlier_error", "m", "of outliers, horizontally in any direction"}, outlier_error_m, 0.0,
         1000.0);
  v.real({"gnss.latitude", "deg", "of the map's origin"}, latitude_deg, -85.0, 85.0);
  v.real({"gnss.longitude", "deg", "of the map's origin"}, longitude_deg, -180.0, 180.0);
  v.real({"gnss.altitude", "m", "of the map's origin"}, altitude_m, -500.0, 9000.0);
}

void WheelSettings::visit(ParameterVisitor& v) {
  v.flag({"wheels.enabled", "", "write wheel odometry"}, enabled);
  v.real({"wheels.rate", "Hz", "messages a second"}, rate_hz, 1.0, 1000.0);
  v.real({"wheels.scale_error", "", "of the way, drawn once"}, scale_error, 0.0, 0.2);
  v.real({"wheels.noise", "m/sqrt(m)", "of the way"}, noise, 0.0, 1.0);
  v.real({"wheels.yaw_noise", "deg/sqrt(m)", "of the heading"}, yaw_noise_deg, 0.0, 10.0);
}

void Scenario::visit(ParameterVisitor& v) {
  v.real({"duration", "s", "of the recording"}, duration_s, 1.0, 7200.0);
  world.visit(v);
  motion.visit(v);
  lidar.visit(v);
  imu.visit(v);
  imperfections.visit(v);
  gnss.visit(v);
  wheels.visit(v);
}

}  // namespace fdi_lio::simulation
