#pragma once

#include <array>
#include <optional>

#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// White noise of the readings, vibration included, while the sensor moves.
///
/// Third differences d = a_3 - 3 a_2 + 3 a_1 - a_0 of white noise have 20 times its variance; of a motion of
/// angular frequency w they leave (w dt)^3 of its amplitude: at 2 Hz and 100 readings a second 0.002. So
///   density^2 = dt mean(|d|^2) / (3 axes * 20).
/// What matters is the noise that stays when the readings are integrated over a scan. White noise of that
/// size shows in means over 50 ms as well; the hum of an engine, which integrates to nothing, does not. The
/// smaller of the two densities counts.
class NoiseMeter {
 public:
  void add(const ImuSample& sample);

  struct Density {
    double acceleration = 0.0;      ///< of one axis [m/s^2/sqrt(Hz)]
    double angular_velocity = 0.0;  ///< [rad/s/sqrt(Hz)]
  };
  /// Nothing with fewer than ten differences of each kind; steps that are not even (gaps) give none.
  std::optional<Density> density() const;

 private:
  class Differences {
   public:
    void add(const ImuSample& sample);
    std::optional<Density> density() const;

   private:
    Eigen::Vector3d third(Eigen::Vector3d ImuSample::*value) const;

    std::array<ImuSample, 4> last_;
    int added_ = 0;
    double acceleration_ = 0.0;  ///< sums of squares over the axes
    double angular_velocity_ = 0.0;
    double step_s_ = 0.0;  ///< sum
    int count_ = 0;
  };

  Differences each_;
  Differences means_;
  ImuSample sum_;  ///< of the block that is being filled; its stamp is that of the first
  double since_first_s_ = 0.0;
  int in_block_ = 0;
};

}  // namespace fdi_lio::imu
