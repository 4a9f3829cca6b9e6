#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/brightness_motion.hpp"
#include "fdi_lio/odometry/estimator_input.hpp"
#include "fdi_lio/odometry/moving_start.hpp"

namespace fdi_lio::odometry {

/// Keeps the first scans of a start that may be in motion, and asks them together whether it was. Two scans
/// alone do not tell where nothing stands beside the road or all walls are smooth; registrations with a wrong
/// velocity then hold on to what travels with the sensor: rings on the ground, vehicles at the same speed.
class StartReview {
 public:
  explicit StartReview(const Config& config);

  /// `state` is what was estimated for the scan, with so much information of its surfaces about the position
  /// (IMU axes, [1/m^2]).
  void add(EstimatorInput input, const imu::NavState& state, const Eigen::Matrix3d& position_information);

  /// The motion at the start, once the scans say that it was clearly another one than estimated. They are
  /// asked after 8 scans, or as soon as the IMU cannot find any more that the sensor stands, and after 16;
  /// the review is over when they are sure, or after the last. `has_witness`: surfaces that stand told the
  /// estimated one from the first two scans alone; it then takes more to overrule it, and most for what is
  /// slower and contradicted by those two scans (`find_start_motion`). Upright is what the accelerometer says
  /// over all scans, or the ground where that is steep against it (`is_steep`), for then the sensor gathers
  /// speed or brakes.
  ///
  /// `seems_to_stand`: the IMU says so, and scans so far agree. Then only a direction that surfaces leave
  /// open is worth a question, which holds up what is to be estimated live.
  std::optional<MovingStart> find_motion(bool has_witness, bool seems_to_stand);

  bool is_over() const { return is_over_; }

  /// All that were added, be it after the review was over.
  const std::vector<EstimatorInput>& inputs() const { return inputs_; }

 private:
  bool may_stand() const;
  bool is_contradicted(const Eigen::Vector3d& v_odom) const;
  Eigen::Vector3d felt_up() const;
  bool is_ground_steep() const;
  std::vector<BrightScan> scans_without_gravity(const Eigen::Vector3d& up_odom) const;
  std::optional<Eigen::Vector3d> open_direction() const;

  Config config_;
  Eigen::Isometry3d T_imu_lidar_;
  Eigen::Matrix3d R_level_odom_ = Eigen::Matrix3d::Identity();  ///< by the ground
  bool has_ground_ = false;
  /// What the accelerometer adds to the velocity and to the position since the first scan in so many seconds
  /// (odom), gravity among it.
  Eigen::Vector3d felt_mps_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d felt_m_ = Eigen::Vector3d::Zero();
  double felt_s_ = 0.0;
  Eigen::Matrix3d position_information_ = Eigen::Matrix3d::Zero();  ///< of all scans, level axes
  std::vector<EstimatorInput> inputs_;
  std::vector<BrightScan> scans_;               ///< what they gained has gravity in it
  std::vector<double> felt_s_of_;               ///< of each
  std::vector<Eigen::Quaterniond> q_odom_imu_;  ///< of each, by the gyro alone
  Eigen::Vector3d first_t_odom_imu_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d newest_t_odom_imu_ = Eigen::Vector3d::Zero();
  std::size_t next_question_ = 8;  ///< number of scans
  bool is_over_ = false;
};

}  // namespace fdi_lio::odometry
