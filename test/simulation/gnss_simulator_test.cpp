#include "fdi_lio/simulation/gnss_simulator.hpp"

#include <cmath>
#include <vector>

#include <GeographicLib/Geocentric.hpp>
#include <gtest/gtest.h>

namespace fdi_lio::simulation {
namespace {

Trajectory straight_drive() {
  std::vector<PoseVector> poses;
  for (int i = 0; i < 200; ++i) {
    PoseVector pose = PoseVector::Zero();
    pose[0] = i;
    poses.push_back(pose);
  }
  return Trajectory(poses, 0.1);
}

GnssSettings perfect() {
  GnssSettings settings;
  settings.rate_hz = 20.0;
  settings.noise_m = settings.drift_m = settings.outage_share = 0.0;
  return settings;
}

/// In the earth's frame, whose distances are true ones.
Eigen::Vector3d position(const GnssFix& fix) {
  Eigen::Vector3d p;
  GeographicLib::Geocentric::WGS84().Forward(fix.latitude_deg, fix.longitude_deg, fix.altitude_m, p.x(),
                                             p.y(), p.z());
  return p;
}

/// Distances of the fixes from those of a perfect receiver.
std::vector<double> errors(const GnssSettings& settings, std::uint64_t seed, int count) {
  const Trajectory drive = straight_drive();
  GnssSimulator receiver(drive, settings, seed);
  GnssSimulator truth(drive, perfect(), seed);
  std::vector<double> result;
  for (int k = 0; k < count; ++k)
    result.push_back((position(receiver.next()) - position(truth.next())).norm());
  return result;
}

TEST(GnssSimulator, PerfectFixesAreAsFarApartAsTheDriveIsLong) {
  const Trajectory drive = straight_drive();
  GnssSimulator receiver(drive, perfect(), 1);
  GnssFix first = receiver.next();
  GnssFix last;
  for (int k = 1; k <= 300; ++k) last = receiver.next();
  EXPECT_TRUE(last.valid);
  EXPECT_DOUBLE_EQ(last.time_s, 15.0);
  const double way_m = (drive.pose(15.0).translation() - drive.pose(0.0).translation()).norm();
  EXPECT_NEAR((position(last) - position(first)).norm(), way_m, 1e-6);
  EXPECT_GT(last.longitude_deg, first.longitude_deg);  // x is east
  EXPECT_NEAR(last.latitude_deg, first.latitude_deg, 1e-6);
}

TEST(GnssSimulator, OutliersHaveTheirShareAndSize) {
  GnssSettings settings = perfect();
  settings.outlier_share = 0.05;
  settings.outlier_error_m = 30.0;
  int outliers = 0;
  for (const double error : errors(settings, 3, 300)) {
    if (error < 1e-6) continue;
    EXPECT_NEAR(error, 30.0, 1e-3);
    ++outliers;
  }
  EXPECT_GE(outliers, 6);  // 15 expected, standard deviation 3.8
  EXPECT_LE(outliers, 27);
}

TEST(GnssSimulator, NoiseHasItsSizeAndIsLargerInHeight) {
  GnssSettings settings = perfect();
  settings.noise_m = 1.5;
  double sum_sq = 0.0;
  for (const double error : errors(settings, 4, 300)) sum_sq += error * error;
  // Two horizontal axes, and three times as much vertically.
  EXPECT_NEAR(std::sqrt(sum_sq / 300.0), 1.5 * std::sqrt(11.0), 0.6);
}

TEST(GnssSimulator, OutagesHaveTheirLength) {
  GnssSettings settings = perfect();
  settings.rate_hz = 5.0;
  settings.outage_share = 0.5;
  settings.outage_length_s = 1.0;
  const Trajectory drive = straight_drive();
  GnssSimulator receiver(drive, settings, 2);
  constexpr int kPieces = 20;
  int out = 0;
  for (int piece = 0; piece < kPieces; ++piece) {
    const bool first = receiver.next().valid;
    for (int k = 1; k < 5; ++k) EXPECT_EQ(receiver.next().valid, first) << piece;
    if (!first) ++out;
  }
  EXPECT_GE(out, 3);  // 10 expected, standard deviation 2.2
  EXPECT_LE(out, 17);
}

}  // namespace
}  // namespace fdi_lio::simulation
