#include "fdi_lio/odometry/shock_guard.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace fdi_lio::odometry {

namespace {

constexpr double kDoubtfulStep = 0.02;  ///< of a scan's prediction [m]
/// A velocity that one scan tells is off by what its position is, over the time since the scan before: it
/// takes a few until the prediction is as good as ever.
constexpr int kScans = 3;

}  // namespace

double ShockGuard::add(double change_mps, double duration_s) {
  if (scans_ > 0) --scans_;
  const double acceleration = change_mps / std::max(1e-6, duration_s);
  const double doubtful_mps =
      change_mps * std::clamp(2.0 * acceleration / shock_acceleration_mps2_ - 1.0, 0.0, 1.0);
  if (doubtful_mps * duration_s <= kDoubtfulStep) return doubtful_mps;
  scans_ = kScans;
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "a shock: by the IMU the velocity changed by " << change_mps
       << " m/s in " << std::setprecision(2) << duration_s
       << " s, which may be false (sensor.shock_acceleration): the scans decide";
  reporter_->report(Severity::kInfo, "imu_shock", text.str());
  return doubtful_mps;
}

}  // namespace fdi_lio::odometry
