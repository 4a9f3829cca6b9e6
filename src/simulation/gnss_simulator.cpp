#include "fdi_lio/simulation/gnss_simulator.hpp"

#include <cmath>

#include <GeographicLib/LocalCartesian.hpp>

#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/random_streams.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kVerticalFactor = 3.0;  // height is that much worse
constexpr double kDriftTime = 60.0;      // seconds over which the slow error forgets itself

Eigen::Vector3d random_vector(double sigma, Random* random) {
  const double x = random->normal();
  const double y = random->normal();
  const double z = random->normal();
  return sigma * Eigen::Vector3d(x, y, kVerticalFactor * z);
}

}  // namespace

GnssSimulator::GnssSimulator(const Trajectory& trajectory, const GnssSettings& settings, std::uint64_t seed)
    : trajectory_(trajectory), settings_(settings), seed_(seed) {
  Random random(seed, kStreamGnss, ~std::uint64_t{0});
  drift_ = random_vector(settings.drift_m, &random);
}

GnssFix GnssSimulator::next() {
  Random random(seed_, kStreamGnss, static_cast<std::uint64_t>(count_));
  GnssFix fix;
  fix.time_s = static_cast<double>(count_) / settings_.rate_hz;
  const double keep = std::exp(-1.0 / (settings_.rate_hz * kDriftTime));
  drift_ = keep * drift_ + random_vector(settings_.drift_m * std::sqrt(1.0 - keep * keep), &random);
  Eigen::Vector3d p =
      trajectory_.pose(fix.time_s).translation() + drift_ + random_vector(settings_.noise_m, &random);
  Random reflections(seed_, kStreamGnssReflections, static_cast<std::uint64_t>(count_));
  if (reflections.chance(settings_.outlier_share)) {
    const double direction = reflections.uniform(0.0, 2.0 * M_PI);
    p += settings_.outlier_error_m * Eigen::Vector3d(std::cos(direction), std::sin(direction), 0.0);
  }
  const GeographicLib::LocalCartesian local(settings_.latitude_deg, settings_.longitude_deg,
                                            settings_.altitude_m);
  local.Reverse(p.x(), p.y(), p.z(), fix.latitude_deg, fix.longitude_deg, fix.altitude_m);
  // Time is cut into pieces as long as an outage; each piece is out with the wanted share.
  const auto piece = static_cast<std::uint64_t>(fix.time_s / settings_.outage_length_s);
  fix.valid = !Random(seed_, kStreamGnssOutages, piece).chance(settings_.outage_share);
  ++count_;
  return fix;
}

}  // namespace fdi_lio::simulation
