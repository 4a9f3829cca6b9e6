#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/simulation/lidar_model.hpp"
#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/trajectory.hpp"
#include "fdi_lio/simulation/world.hpp"

namespace fdi_lio::simulation {

/// One firing of one beam as the sensor reports it.
struct LidarReturn {
  bool valid = false;
  Eigen::Vector3f p_lidar = Eigen::Vector3f::Zero();  ///< metres, nominal beam direction
  float range_m = 0.0f;
  float intensity = 0.0f;          ///< Velodyne: 0 to 255, calibrated; Ouster: signal photons
  std::uint16_t reflectivity = 0;  ///< Ouster: calibrated, 0 to 255
  std::uint16_t ambient = 0;       ///< Ouster: near infrared light of the surroundings
  std::int16_t label = 0;          ///< 0: static, otherwise the moving object's id
};

/// One revolution, columns in firing order, `returns[column * beams + ring]`.
struct LidarScan {
  double start_s = 0.0;   ///< true time of the first column, seconds since the start of the recording
  double period_s = 0.1;  ///< the columns are evenly spaced over it
  int columns = 0;
  int beams = 0;
  std::vector<LidarReturn> returns;

  /// Time of a column after the first, seconds.
  double column_time(int column) const { return period_s * column / columns; }
};

/// Errors of one unit of a sensor, drawn once for a recording.
struct LidarErrors {
  std::vector<double> elevation_rad;  ///< one a beam; true = nominal + error
  std::vector<double> azimuth_rad;
  std::vector<double> range_m;
  std::vector<double> gain;  ///< factor on the intensity
  double range_walk_m = 0.0;
  double mixed_share = 0.0;
  double dropout = 0.0;
  double time_offset_s = 0.0;                                     ///< reported stamp = true time + offset
  Eigen::Isometry3d T_imu_lidar = Eigen::Isometry3d::Identity();  ///< true mounting
  bool weak_signal_noise = false;  ///< range noise grows when the signal is weak
};

/// Draws the errors of a unit; all zero and the nominal mounting when imperfections are off.
LidarErrors draw_lidar_errors(const Scenario& scenario, const LidarModel& model, std::uint64_t seed);

/// Casts the rays of whole revolutions. Every column is fired from the pose at its own time, moving objects
/// stand where they are at that time. The result depends on the arguments only, not on the number of threads.
class LidarSimulator {
 public:
  /// Keeps references to `world` and `trajectory`.
  LidarSimulator(const World& world, const Trajectory& trajectory, LidarModel model, LidarErrors errors,
                 double dust_per_m, const LidarSettings& settings, std::uint64_t seed);

  /// Revolution number `index`, which starts at index / rate seconds.
  LidarScan simulate(int index) const;

  const LidarModel& model() const { return model_; }
  const LidarErrors& errors() const { return errors_; }

 private:
  struct Column;
  void simulate_column(int scan, int column, const std::vector<NearObject>& near, LidarScan* result) const;
  LidarReturn measure(const Column& column, std::size_t beam, Hit hit, Random* random) const;
  Hit through_glass(const Column& column, const Eigen::Vector3f& direction, Hit hit, Random* random) const;
  double mixed_range(const Column& column, const Eigen::Vector3f& direction, const Hit& hit,
                     Random* random) const;
  void fill_intensity(double effective_reflectivity, bool retro, double range, std::size_t beam,
                      Random* random, LidarReturn* point) const;

  const World& world_;
  const Trajectory& trajectory_;
  LidarModel model_;
  LidarErrors errors_;
  double dust_per_m_;
  double start_azimuth_rad_;
  std::uint64_t seed_;
  std::vector<Eigen::Vector3f> nominal_directions_;  ///< of each beam at column azimuth 0, lidar frame
  std::vector<Eigen::Vector3f> true_directions_;
};

}  // namespace fdi_lio::simulation
