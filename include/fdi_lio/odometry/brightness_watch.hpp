#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/odometry/bright_scan.hpp"
#include "fdi_lio/odometry/brightness_motion.hpp"
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
/// Where surfaces hold dv, but to some hundredths only, the errors of beams may feign it, since they travel
/// with the sensor: there two answers in a row must refute it, and for some seconds surfaces count for
/// nothing, either.
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
  /// Scans that are asked together, and what was estimated for them.
  struct Window {
    std::vector<BrightScan> scans;
    std::vector<imu::NavState> states;

    void clear();
    /// By how much the first velocity is off along itself.
    BrightnessOffset offset();
  };
  /// Questions follow each other without a pause until some in a row have found nothing, then with longer
  /// ones.
  struct Pace {
    std::size_t agreeing = 0;  ///< in a row
    std::size_t pause = 0;     ///< between questions [scans]
    std::size_t scans = 0;     ///< since the last

    bool is_due() { return scans++ >= pause; }
    void agree();
  };

  Eigen::Vector2d measure(double variance);
  void advance(const imu::NavState& state, const TrustedInformation& information);
  bool is_doubtful() const;
  bool is_contradicted(const BrightnessOffset& offset, double times) const;
  std::optional<Correction> ask_velocity();
  std::optional<Correction> test_surfaces(const BrightScan& scan, const imu::NavState& state);
  void distrust(const BrightnessOffset& offset);
  Correction correct(const BrightnessOffset& offset, const Eigen::Vector3d& ahead);

  Eigen::Matrix3d R_imu_lidar_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();           ///< P
  Eigen::Matrix3d position_covariance_ = Eigen::Matrix3d::Zero();  ///< sum of what came to P_pp, ahead
  Eigen::Vector3d ahead_ = Eigen::Vector3d::Zero();                ///< of the newest scan, a unit vector
  std::optional<Stamp> newest_;
  double surfaces_variance_ = 0.0;  ///< of the velocity by surfaces alone, at the newest scan
  Window window_;                   ///< of a velocity that is doubtful, or that textures alone hold
  Pace pace_;
  Window surfaces_window_;  ///< of a velocity that surfaces hardly hold
  Pace surfaces_pace_;
  double suspected_mps_ = 0.0;  ///< what the last question about surfaces contradicted them by; 0: not at all
  double distrust_s_ = 0.0;     ///< for so long textures count for nothing
  bool distrusts_surfaces_ = false;  ///< surfaces either, then
};

}  // namespace fdi_lio::odometry
