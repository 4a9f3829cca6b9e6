#include "fdi_lio/simulation/traffic.hpp"

#include <algorithm>
#include <memory>

#include "fdi_lio/simulation/mesh.hpp"

namespace fdi_lio::simulation {

bool comes_near(const PoseFunction& pose, const Trajectory& trajectory, double distance) {
  constexpr double kStep = 0.2;  // seconds
  for (double t = 0.0; t < trajectory.duration_s(); t += kStep) {
    if ((pose(t).translation() - trajectory.pose(t).translation()).head<2>().norm() < distance) return true;
  }
  return false;
}

PoseFunction convoy_drive(const Route& route, const MotionSettings& motion, const Ground& ground,
                          double duration, double start) {
  constexpr double kPeriod = 0.1;
  auto shared = std::make_shared<const Route>(route);
  auto progress = std::make_shared<const std::vector<double>>(
      plan_progress(route, motion, start, duration + 5.0, kPeriod));
  return [=](double t) {
    const double index = std::clamp(t / kPeriod, 0.0, static_cast<double>(progress->size()) - 1.001);
    const auto i = static_cast<std::size_t>(index);
    const double u = index - static_cast<double>(i);
    const Route::Point point = shared->at((1.0 - u) * (*progress)[i] + u * (*progress)[i + 1]);
    const double x = point.position.x(), y = point.position.y();
    return pose_at(x, y, ground(x, y), point.heading);
  };
}

}  // namespace fdi_lio::simulation
