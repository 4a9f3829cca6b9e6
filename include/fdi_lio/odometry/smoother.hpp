#pragma once

#include <deque>
#include <optional>

#include <Eigen/Core>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/odometry/factors.hpp"
#include "fdi_lio/odometry/gravity_estimate.hpp"

namespace fdi_lio::odometry {

/// Fixed-lag smoother over the states of the newest scans and what they share, gravity and the calibration of
/// lidar against IMU: a prior left by marginalised states, motion between neighbours, and the condensed lidar
/// information of each scan. Solved by Ceres.
class Smoother {
 public:
  /// How well the calibration is known; 0: it is not estimated.
  struct CalibrationSigma {
    double mounting_rad = 0.0;         ///< rotation of T_imu_lidar, about each axis
    double lidar_time_offset_s = 0.0;  ///< NavState::lidar_time_offset_s
    double gyro_scale = 0.0;           ///< scale of each axis of the gyro
    double gyro_lean = 0.0;            ///< of each axis of the gyro towards each other one [rad]
  };

  /// `tilt_walk`: how fast the local map, and with it the frame of the states, tilts against
  /// gravity on the way [rad/sqrt(m)], beyond what NavState::beam_elevation explains: the random walk of
  /// gravity's direction in that frame.
  Smoother(int window_size, double gravity_mps2, const CalibrationSigma& calibration, double tilt_walk);

  /// Standard deviations of the first state.
  struct InitialSigma {
    double theta = 1e-3;
    double position = 1e-3;
    double velocity = 10.0;
    double gyro_bias = 0.02;
    double accel_bias = 0.1;
    double gravity = 0.1;
    /// Of the mean acceleration measured at rest, which ties accelerometer bias and gravity together
    /// [m/s^2], about those of the state: b_a - R' g has to be what was measured. 0: not at rest.
    double rest_acceleration = 0.0;
    double beam_elevation = 0.0;  ///< [rad]; 0: it is not estimated
  };

  /// Starts anew from one state.
  void start(const imu::NavState& state, const InitialSigma& sigma);

  /// Adds a state predicted by `motion` from the newest one; the oldest is marginalised when the window is
  /// full. `bend`: of the map on that step (map_bend()).
  void add(const imu::NavState& predicted, const imu::Preintegration& motion, bool with_gravity,
           const Eigen::Vector3d& bend);

  /// The newest state by another prediction instead of the one that it was added with. `error_before`: of the
  /// motion before that one.
  void replace_newest(const imu::NavState& predicted, const imu::Preintegration& motion,
                      const imu::MotionError& error_before);

  /// This much of NavState::beam_elevation [rad] is taken out of the scans from now on.
  void reduce_beam_elevation(double taken_out);

  /// Sets (replaces) the lidar information of the newest state.
  void set_lidar(const matching::LidarInformation& information);

  /// Moves what is estimated of all states by these (odom axes), gravity at its magnitude, and leaves what is
  /// known of them as it is: for who knows better than the covariance what the estimates may be off by.
  void shift(const Eigen::Vector3d& velocity, const Eigen::Vector3d& gravity);

  /// Minimises over the window; the newest state is then `newest()`. False when Ceres found no usable
  /// solution, and the states are as they were.
  bool solve();

  const imu::NavState& newest() const { return window_.back().state; }
  bool empty() const { return window_.empty(); }

  /// Sets the status that is carried with the newest state.
  void annotate_newest(imu::ImuStatus status, const Eigen::Vector3d& w_imu);

  /// Covariance of the newest state [dtheta, dt, dv, db_g, db_a], from the normal equations at the solution.
  Matrix15d covariance() const;

  /// What the newest state knows of gravity, likewise.
  GravityEstimate gravity() const;

 private:
  struct Entry {
    imu::NavState state;
    imu::Preintegration motion;  ///< from the entry before
    bool has_motion = false;
    bool with_gravity = false;
    Eigen::Vector3d bend = Eigen::Vector3d::Zero();  ///< of the map since the entry before
    std::optional<matching::LidarInformation> lidar;
  };
  class Problem;

  /// The information of all states and of what they share at the solution.
  Eigen::MatrixXd information() const;
  void marginalise_oldest();
  /// Moves the information (H, b) of [state, shared] about `to` on by the step from `from`: gravity turns
  /// with the map, and by an unknown part more, the beams' elevation may change, and the clocks drift.
  void move_on(const imu::NavState& from, const Entry& to, Eigen::MatrixXd* H, Eigen::VectorXd* b) const;

  int window_size_;
  double gravity_mps2_;
  CalibrationSigma calibration_;
  double tilt_walk_;
  double beam_elevation_sigma_ = 0.0;
  std::deque<Entry> window_;
  StatePrior prior_;
};

}  // namespace fdi_lio::odometry
