#include <cmath>
#include <random>

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "fdi_lio/odometry/beam_calibration.hpp"

namespace fdi_lio::odometry {
namespace {

constexpr int kRings = 32;

/// Where a beam really points, and what its wrong geometry makes of it, point by point.
Eigen::Vector3d beam(double range_m, double elevation_rad, double azimuth_rad) {
  return range_m * Eigen::Vector3d(std::cos(elevation_rad) * std::cos(azimuth_rad),
                                   std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad));
}

double elevation_rad(int ring) { return (-20.0 + ring * 0.7) * M_PI / 180.0; }

/// Feeds points on planes of random direction, as a map that knows the truth would see them.
void drive(const std::vector<Eigen::Vector2d>& errors, int scans, BeamCalibration* calibration) {
  std::mt19937 generator(4);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.02);
  for (int scan = 0; scan < scans; ++scan) {
    for (int ring = 0; ring < kRings; ++ring) {
      for (int k = 0; k < 40; ++k) {
        const double range_m = 12.0 + 10.0 * uniform(generator);
        const double azimuth = M_PI * uniform(generator);
        const Eigen::Vector3d normal =
            Eigen::Vector3d(uniform(generator), uniform(generator), uniform(generator)).normalized();
        const Eigen::Vector3d truth = beam(range_m, elevation_rad(ring), azimuth);
        const Eigen::Vector3d measured =
            beam(range_m + errors[ring][0], elevation_rad(ring) + errors[ring][1], azimuth);
        const Eigen::Vector3d corrected = measured + calibration->correction(ring, measured);
        calibration->observe(ring, corrected, normal, normal.dot(corrected - truth) + noise(generator), 4e-4);
      }
    }
    calibration->update();
  }
}

TEST(BeamCalibration, FindsErrorsThatDifferFromBeamToBeam) {
  std::mt19937 generator(9);
  std::normal_distribution<double> range(0.0, 0.015);
  std::normal_distribution<double> angle(0.0, 6e-4);
  std::vector<Eigen::Vector2d> errors(kRings);
  for (Eigen::Vector2d& error : errors) error << range(generator), angle(generator);
  BeamCalibration calibration{BeamCalibrationConfig()};
  drive(errors, 60, &calibration);
  // Truth without its parabola over the rings, by an independent fit.
  Eigen::MatrixXd powers(kRings, 3);
  Eigen::MatrixXd truth(kRings, 2);
  for (int ring = 0; ring < kRings; ++ring) {
    powers.row(ring) << 1.0, ring, ring * ring;
    truth.row(ring) = errors[ring].transpose();
  }
  truth -= powers * powers.colPivHouseholderQr().solve(truth);
  for (int ring = 0; ring < kRings; ++ring) {
    EXPECT_NEAR(calibration.error(ring)[0], truth(ring, 0), 2e-3) << ring;
    EXPECT_NEAR(calibration.error(ring)[1], truth(ring, 1), 1.2e-4) << ring;
  }
}

TEST(BeamCalibration, CorrectionMovesAPointAgainstItsError) {
  std::vector<Eigen::Vector2d> errors(kRings, Eigen::Vector2d::Zero());
  errors[7] << 0.03, 0.0;
  errors[20] << 0.0, 1e-3;
  BeamCalibration calibration{BeamCalibrationConfig()};
  drive(errors, 40, &calibration);
  const Eigen::Vector3d far = beam(20.0, elevation_rad(7), 0.4);
  EXPECT_LT(calibration.correction(7, far).dot(far.normalized()), -0.02);
  const Eigen::Vector3d low = beam(20.0, elevation_rad(20), -1.0);
  EXPECT_LT(calibration.correction(20, low).z(), -0.012);
  EXPECT_EQ(calibration.correction(500, far), Eigen::Vector3d::Zero());
}

TEST(BeamCalibration, CommonElevationTurnsEveryBeam) {
  BeamCalibration calibration{BeamCalibrationConfig()};
  calibration.add_common_elevation(3e-3);
  calibration.add_common_elevation(-1e-3);
  const Eigen::Vector3d corrected =
      beam(20.0, 0.1 + 2e-3, 0.7) + calibration.correction(3, beam(20.0, 0.1 + 2e-3, 0.7));
  EXPECT_LT((corrected - beam(20.0, 0.1, 0.7)).norm(), 1e-4);
  EXPECT_EQ(calibration.error(3), Eigen::Vector2d::Zero());
}

TEST(BeamCalibration, ErrorsThatAreSmoothOverTheBeamsAreLeft) {
  // A tilt or a bend of all beams together could as well be one of the world.
  std::vector<Eigen::Vector2d> errors(kRings);
  for (int ring = 0; ring < kRings; ++ring) errors[ring] << 0.01 + 5e-4 * ring, -5e-4 + 1e-6 * ring * ring;
  BeamCalibration calibration{BeamCalibrationConfig()};
  drive(errors, 40, &calibration);
  for (int ring = 0; ring < kRings; ++ring) {
    EXPECT_LT(std::abs(calibration.error(ring)[0]), 2e-3) << ring;
    EXPECT_LT(std::abs(calibration.error(ring)[1]), 2e-4) << ring;
  }
}

}  // namespace
}  // namespace fdi_lio::odometry
