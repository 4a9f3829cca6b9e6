#pragma once

#include <optional>

#include <Eigen/Core>

namespace fdi_lio::mapping {

/// The way on which the map about the sensor becomes another one.
///
/// While what is seen was seen from the places before, too, the map stays and so do its errors: a hall that
/// is walked up and down does not tilt. With L the root mean square distance of the features from their
/// centroid, two places 2 L apart have little in common. So the way is that of an anchor which the sensor
/// pulls along at a distance of 2 L.
class RenewedWay {
 public:
  /// The sensor is at `t_odom` now, and sees features of radius `radius_m`; 0 where none is matched, when
  /// those of before count.
  void advance(const Eigen::Vector3d& t_odom, double radius_m);

  /// Since the first place [m].
  double way_m() const { return way_m_; }

 private:
  std::optional<Eigen::Vector3d> anchor_;
  double radius_m_ = 0.0;  ///< of the newest features
  double way_m_ = 0.0;
};

}  // namespace fdi_lio::mapping
