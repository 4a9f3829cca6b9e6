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
/// Where surfaces hold dv, but to some hundredths of a metre per second only, the errors of beams may feign
/// it, since they travel with the sensor: there two answers in a row must refute it, and for some seconds
/// surfaces count for nothing, either.
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
  /// Asks 16 scans in a row, again and again: without a pause until some answers in a row agree with what is
  /// estimated, then with longer ones.
  class Inquiry {
   public:
    struct Answer {
      BrightnessOffset offset;  ///< along `ahead`
      Eigen::Vector3d ahead;    ///< of the first scan, a unit vector
    };

    bool is_due() { return since_last_++ >= pause_; }
    std::optional<Answer> add(const BrightScan& scan, const imu::NavState& state);
    /// The scans so far do not follow each other, or were estimated otherwise.
    void forget_scans();
    void note_agreement();
    void note_contradiction() { agreeing_ = pause_ = 0; }

   private:
    std::vector<BrightScan> scans_;
    std::vector<imu::NavState> states_;  ///< of `scans_`
    std::size_t agreeing_ = 0;           ///< in a row
    std::size_t pause_ = 0;              ///< [scans]
    std::size_t since_last_ = 0;         ///< [scans]
  };

  Eigen::Vector2d measure(double variance);
  void advance(const imu::NavState& state, const TrustedInformation& information);
  bool is_doubtful() const;
  bool contradicts(const BrightnessOffset& offset) const;
  std::optional<Correction> review_velocity(const Inquiry::Answer& answer);
  std::optional<Correction> review_surfaces(const Inquiry::Answer& answer);
  void distrust(const Inquiry::Answer& answer, bool surfaces);
  Correction correct(const Inquiry::Answer& answer);

  Eigen::Matrix3d R_imu_lidar_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();           ///< P
  Eigen::Matrix3d position_covariance_ = Eigen::Matrix3d::Zero();  ///< sum of what came to P_pp, ahead
  Eigen::Vector3d ahead_ = Eigen::Vector3d::Zero();                ///< of the newest scan, a unit vector
  std::optional<Stamp> newest_;
  double surfaces_variance_ = 0.0;  ///< of the velocity by surfaces alone, at the newest scan
  Inquiry of_velocity_;             ///< that is doubtful, or that textures alone hold
  Inquiry of_surfaces_;             ///< that hardly hold it
  double suspected_mps_ = 0.0;  ///< by what the last answer about surfaces contradicts them; 0: it does not
  double distrust_s_ = 0.0;     ///< for so long textures count for nothing
  bool distrusts_surfaces_ = false;  ///< then surfaces do not, either
};

}  // namespace fdi_lio::odometry
