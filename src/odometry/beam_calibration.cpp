#include "fdi_lio/odometry/beam_calibration.hpp"

#include <cmath>

#include <Eigen/Cholesky>

#include "fdi_lio/matching/beam_motions.hpp"

namespace fdi_lio::odometry {

void BeamCalibration::observe(std::size_t ring, const Eigen::Vector3d& beam_m,
                              const Eigen::Vector3d& normal_lidar, double residual_m, double variance_m2) {
  if (ring >= beams_.size()) beams_.resize(ring + 1);
  Beam& beam = beams_[ring];
  const Eigen::Vector2d J =
      matching::beam_motions(beam_m, Eigen::Vector3d::UnitZ()).transpose() * normal_lidar;
  const double before_m = residual_m + J.dot(beam.error);
  const double weight = 1.0 / (variance_m2 * config_.correlation_factor);
  beam.information += weight * J * J.transpose();
  beam.moment += weight * before_m * J;
}

void BeamCalibration::update() {
  const double keep = std::exp(-1.0 / config_.memory_scans);
  const double range_prior = 1.0 / (config_.range_sigma_m * config_.range_sigma_m);
  const double angle_prior = 1.0 / (config_.angle_sigma_rad * config_.angle_sigma_rad);
  const Eigen::Vector2d prior(range_prior, angle_prior);
  for (Beam& beam : beams_) {
    Eigen::Matrix2d information = beam.information;
    information.diagonal() += prior;
    beam.error = information.ldlt().solve(beam.moment);
    beam.information *= keep;
    beam.moment *= keep;
  }
  remove_smooth_part();
}

/// An error that varies smoothly from beam to beam cannot be told from a bent world that the sensor pitches,
/// climbs or turns along: the map would bend with it. Only the deviation from a parabola over the beams
/// stays.
void BeamCalibration::remove_smooth_part() {
  Eigen::Matrix3d moments = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Matrix<double, 3, 2> products = Eigen::Matrix<double, 3, 2>::Zero();
  const auto powers = [this](std::size_t ring) {
    const double x = 2.0 * static_cast<double>(ring) / static_cast<double>(beams_.size()) - 1.0;
    return Eigen::Vector3d(1.0, x, x * x);
  };
  for (std::size_t ring = 0; ring < beams_.size(); ++ring) {
    if (beams_[ring].information.isZero()) continue;
    moments += powers(ring) * powers(ring).transpose();
    products += powers(ring) * beams_[ring].error.transpose();
  }
  const Eigen::Matrix<double, 3, 2> coefficients = moments.ldlt().solve(products);
  for (std::size_t ring = 0; ring < beams_.size(); ++ring) {
    if (!beams_[ring].information.isZero()) beams_[ring].error -= coefficients.transpose() * powers(ring);
  }
}

Eigen::Vector3d BeamCalibration::correction(std::size_t ring, const Eigen::Vector3d& beam_m) const {
  return -matching::beam_motions(beam_m, Eigen::Vector3d::UnitZ()) *
         (error(ring) + Eigen::Vector2d(0.0, common_elevation_rad_));
}

Eigen::Vector2d BeamCalibration::error(std::size_t ring) const {
  return ring < beams_.size() ? beams_[ring].error : Eigen::Vector2d::Zero();
}

}  // namespace fdi_lio::odometry
