#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/bright_scan.hpp"
#include "fdi_lio/odometry/trusted_information.hpp"

namespace fdi_lio::odometry {

/// Watches over the velocity where neither surfaces nor textures hold it, as of 16 beams on an open road. The
/// smoother does not know: it takes the map as given, which its own scans made, so that chance confirms what
/// it predicts, and its covariance stays small however far the velocity drifts off.
///
/// What position, velocity and acceleration may be off by along the way is kept here, as the covariance P of
/// [dp, dv, da]: da is a random walk, dv and dp its integrals, and surfaces and textures hold dv as far as
/// they are more than noise. While dv is doubtful, the brightness of each 16 scans is asked for it
/// (`find_brightness_offset`), and the answer corrects dv and da with the gains of a Kalman filter. The
/// position, which the map holds where it is, keeps its error.
///
/// Where textures alone hold dv, they may confirm a wrong one as well: there brightness is asked now and then
/// all the same, and when it refutes dv it corrects it, and for some seconds textures count for nothing.
class BrightnessWatch {
 public:
  explicit BrightnessWatch(const Eigen::Isometry3d& T_imu_lidar) : R_imu_lidar_(T_imu_lidar.linear()) {}

  struct Correction {
    Eigen::Vector3d velocity;      ///< to be added, odom axes [m/s]
    Eigen::Vector3d acceleration;  ///< to be added to gravity, odom axes [m/s^2]
  };

  /// A scan, deskewed with `v_deskew` (odom axes), what was estimated for it, and what can be trusted of what
  /// tells its position. Returns a correction after 16 scans with a doubtful, or a refuted velocity.
  std::optional<Correction> add(const FeatureSet& features, const Eigen::Vector3d& v_deskew,
                                const imu::NavState& state, const TrustedInformation& information);

  /// The estimate begins anew, with what is known (standard deviations) of its velocity [m/s] and of what is
  /// taken for gravity [m/s^2]; at least 0.05 and 0.1 are assumed.
  void reset(double velocity_sigma, double gravity_sigma);

  /// Of what the position is off by because of the velocity since the first scan, odom axes [m^2].
  const Eigen::Matrix3d& position_covariance() const { return position_covariance_; }

  /// Of the newest velocity, odom axes [(m/s)^2].
  Eigen::Matrix3d velocity_covariance() const { return covariance_(1, 1) * ahead_ * ahead_.transpose(); }

 private:
  Eigen::Vector2d measure(double variance);
  void advance(const imu::NavState& state, const TrustedInformation& information);
  bool is_to_be_tested(const TrustedInformation& information);
  std::optional<Correction> ask();
  bool is_doubtful() const;
  void forget_scans();

  Eigen::Matrix3d R_imu_lidar_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();           ///< P
  Eigen::Matrix3d position_covariance_ = Eigen::Matrix3d::Zero();  ///< sum of what came to P_pp, ahead
  Eigen::Vector3d ahead_ = Eigen::Vector3d::Zero();                ///< of the newest scan, a unit vector
  std::optional<Stamp> newest_;
  std::size_t agreeing_tests_ = 0;  ///< in a row
  std::size_t pause_ = 0;           ///< between tests, in scans
  std::size_t scans_since_test_ = 0;
  double distrust_s_ = 0.0;  ///< for so long textures count for nothing
  std::vector<BrightScan> scans_;
  std::vector<imu::NavState> states_;  ///< of `scans_`
};

}  // namespace fdi_lio::odometry
