#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/parameter_visitor.hpp"

namespace fdi_lio::simulation {

/// What the place looks like. Which values a world uses is said in docs/simulator.md.
struct WorldSettings {
  std::string type = "street";
  int cars = 16;              ///< moving cars
  int walkers = 20;           ///< moving people
  double parked_share = 0.5;  ///< share of parking slots that are taken
  double trees = 1.0;         ///< relative density of trees
  double relief = 1.0;        ///< scale of what stands out of walls, or of rock roughness
  double texture = 1.0;       ///< scale of the contrast of textures
  double marks = 1.0;         ///< share of paint marks, signs and fittings that are there
  double length_m = 220.0;    ///< of one straight (tunnel, mine, corridor, highway)
  double width_m = 10.0;      ///< of a tube or corridor
  double height_m = 6.0;      ///< of a tube or corridor
  double rolling_m = 0.5;     ///< amplitude of the rolling ground
  double dust_per_m = 0.0;    ///< chance of a dust return per metre of ray

  void visit(ParameterVisitor& visitor);
};

struct MotionSettings {
  std::string type = "vehicle";  ///< vehicle | handheld | kitti
  double speed_mps = 12.0;
  double max_acceleration = 2.5;          ///< m/s^2
  double max_lateral_acceleration = 2.8;  ///< m/s^2
  double stand_s = 2.0;                   ///< time of standing still at the start
  double start_speed_mps = 0.0;           ///< above 0: no standing, the recording starts at this speed
  double vibration = 1.0;                 ///< scale of roll, pitch and heave of the vehicle
  double shake_rad_s = 0.0;               ///< peak rate of hand-held rotations
  double imu_height_m = 1.43;             ///< above the ground
  std::string pose_file;                  ///< for type kitti

  void visit(ParameterVisitor& visitor);
};

struct LidarSettings {
  std::string model = "hdl64e";  ///< hdl64e | vlp16 | os1_64 | os0_128
  int columns = 0;               ///< firings a revolution; 0: the model's own
  double rate_hz = 10.0;
  double max_range_m = 0.0;          ///< 0: the model's own
  double range_noise_m = -1.0;       ///< standard deviation; negative: the model's own
  double start_azimuth_deg = 180.0;  ///< where a revolution starts, counter-clockwise from x
  bool stamp_at_end = false;  ///< header stamp at the last point, negative times (Velodyne layout only)
  double latency_s = 0.008;   ///< from the last point to the reception of the cloud
  Eigen::Vector3d t_imu_lidar = Eigen::Vector3d(0.0, 0.0, 0.3);  ///< nominal
  Eigen::Quaterniond q_imu_lidar = Eigen::Quaterniond::Identity();

  void visit(ParameterVisitor& visitor);
};

struct ImuSettings {
  double rate_hz = 100.0;
  bool nine_axis = false;
  double gyro_noise = 2e-4;       ///< rad/s/sqrt(Hz)
  double accel_noise = 2e-3;      ///< m/s^2/sqrt(Hz)
  double gyro_bias = 0.003;       ///< standard deviation of the initial bias, rad/s
  double accel_bias = 0.03;       ///< standard deviation of the initial bias, m/s^2
  double gyro_bias_walk = 1e-5;   ///< rad/s^2/sqrt(Hz)
  double accel_bias_walk = 1e-4;  ///< m/s^3/sqrt(Hz)
  double gravity_mps2 = 9.81;

  void visit(ParameterVisitor& visitor);
};

/// Errors of real sensors that the reported data do not show. Sizes are standard deviations unless said
/// otherwise.
struct ImperfectionSettings {
  bool enabled = true;
  double beam_elevation_deg = 0.03;
  double beam_azimuth_deg = 0.03;
  double beam_range_m = 0.015;
  double beam_gain = 0.08;       ///< relative intensity gain of a beam
  double range_walk_m = 0.02;    ///< largest range error by reflectivity
  double mixed_share = 0.3;      ///< share of the points that see two ends of the beam's footprint
  double dropout = 0.003;        ///< share of the points that are lost anyway
  double time_offset_s = 0.001;  ///< the lidar's clock is ahead of the IMU's by this much (not random)
  double extrinsic_rotation_deg = 0.2;
  double extrinsic_translation_m = 0.01;
  double gyro_scale = 0.003;   ///< of each axis
  double accel_scale = 0.003;  ///< of each axis
  double imu_axes_deg = 0.1;   ///< what each axis of gyro and accelerometer leans towards each other one

  void visit(ParameterVisitor& visitor);
};

struct GnssSettings {
  bool enabled = false;
  double rate_hz = 1.0;
  double noise_m = 1.0;       ///< white, each horizontal axis; three times as much vertically
  double drift_m = 1.5;       ///< slow error, standard deviation
  double outage_share = 0.2;  ///< of the time without a fix
  double outage_length_s = 15.0;
  double outlier_share = 0.0;   ///< of the fixes, as by reflected signals
  double outlier_error_m = 30;  ///< of those, horizontally in any direction
  double latitude_deg = 49.0;   ///< of the map's origin
  double longitude_deg = 8.4;
  double altitude_m = 115.0;

  void visit(ParameterVisitor& visitor);
};

struct WheelSettings {
  bool enabled = false;
  double rate_hz = 50.0;
  double scale_error = 0.01;   ///< of the way, standard deviation, drawn once
  double noise = 0.01;         ///< of the way, m/sqrt(m)
  double yaw_noise_deg = 0.2;  ///< deg/sqrt(m)

  void visit(ParameterVisitor& visitor);
};

/// Everything that `simulate_bag` draws a recording from, apart from the seed.
struct Scenario {
  double duration_s = 60.0;
  WorldSettings world;
  MotionSettings motion;
  LidarSettings lidar;
  ImuSettings imu;
  ImperfectionSettings imperfections;
  GnssSettings gnss;
  WheelSettings wheels;

  void visit(ParameterVisitor& visitor);
};

/// Reads a scenario file and then `overrides` (`key=value`, dotted keys). Throws Error that lists every
/// unknown key, wrong type and value out of range.
Scenario load_scenario(const std::string& path, const std::vector<std::string>& overrides);

/// Every value as used, as YAML that `load_scenario` reads back. Each line starts with `indent` spaces.
void write_scenario(Scenario scenario, std::ostream& out, int indent);

}  // namespace fdi_lio::simulation
