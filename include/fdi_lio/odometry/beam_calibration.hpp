#pragma once

#include <vector>

#include <Eigen/Core>

namespace fdi_lio::odometry {

struct BeamCalibrationConfig {
  double range_sigma_m = 0.02;      ///< expected deviation of a beam's range error
  double angle_sigma_rad = 9e-4;    ///< expected deviation of a beam's elevation error
  double memory_scans = 200.0;      ///< after which observations count 1/e
  double correlation_factor = 4.0;  ///< residuals of one beam and scan that count as one independent
};

/// Systematic errors of each beam, learned while driving: range and elevation.
///
/// Every laser of a spinning lidar has its own small errors (centimetres, hundredths of a degree). On smooth
/// surfaces they make a ripple that moves with the sensor. A scan matches its own ripple in the map best when
/// it stands still, so that on empty roads speed is underestimated. The map averages over many beams: what a
/// beam's points deviate from it on the average is the error of the beam.
///
/// The error x = [range, elevation] of one beam follows from point-to-plane residuals r of its points, taken
/// before the correction: r = J x + noise, J = [n . d, rho n . e], with the plane's normal n, the direction d
/// of the beam, e the direction that it moves to with elevation, and the range rho. Least squares with
/// exponential forgetting, and zero with the stated deviations as prior. A parabola over the beams is taken
/// out.
class BeamCalibration {
 public:
  explicit BeamCalibration(const BeamCalibrationConfig& config) : config_(config) {}

  /// Adds one residual [m] of a point (lidar frame; `beam_m` is its position relative to where the sensor was
  /// when it fired) whose position was corrected with the errors that hold now.
  void observe(std::size_t ring, const Eigen::Vector3d& beam_m, const Eigen::Vector3d& normal_lidar,
               double residual_m, double variance_m2);

  /// Ends a scan: solves for the errors of every beam and forgets a little.
  void update();

  /// Adds to the error of elevation that all beams share, which residuals do not show.
  void add_common_elevation(double error_rad) { common_elevation_rad_ += error_rad; }

  /// What to add to the position of a point, [m] in the lidar frame.
  Eigen::Vector3d correction(std::size_t ring, const Eigen::Vector3d& beam_m) const;

  /// [range m, elevation rad] of a beam without what all share; zero for beams never seen.
  Eigen::Vector2d error(std::size_t ring) const;

 private:
  struct Beam {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    Eigen::Vector2d error = Eigen::Vector2d::Zero();
  };

  void remove_smooth_part();

  BeamCalibrationConfig config_;
  std::vector<Beam> beams_;
  double common_elevation_rad_ = 0.0;
};

}  // namespace fdi_lio::odometry
