#include "fdi_lio/simulation/sweep.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::simulation {

Eigen::Vector3d beside(const Route& route, const Ground& ground, double s, double left, double up) {
  const Route::Point point = route.at(s);
  const double base = ground(point.position.x(), point.position.y());
  return {point.position.x() - left * std::sin(point.heading),
          point.position.y() + left * std::cos(point.heading), base + up};
}

Eigen::Isometry3d pose_beside(const Route& route, const Ground& ground, double s, double left, double up) {
  const Eigen::Vector3d p = beside(route, ground, s, left, up);
  return pose_at(p.x(), p.y(), p.z(), route.at(s).heading);
}

std::vector<double> stations(double begin, double end, double step) {
  const int count = std::max(1, static_cast<int>(std::ceil((end - begin) / step)));
  std::vector<double> result;
  for (int i = 0; i <= count; ++i) result.push_back(begin + (end - begin) * i / count);
  return result;
}

void sweep(Mesh* mesh, const Route& route, const Ground& ground, const std::vector<double>& at,
           const std::vector<ProfilePoint>& profile, MaterialId material, double v_origin) {
  std::vector<double> v{v_origin};
  for (std::size_t i = 1; i < profile.size(); ++i) {
    v.push_back(v.back() +
                std::hypot(profile[i].left - profile[i - 1].left, profile[i].up - profile[i - 1].up));
  }
  add_grid(mesh, static_cast<int>(at.size()) - 1, static_cast<int>(profile.size()) - 1, material,
           [&](int column, int row) {
             const auto i = static_cast<std::size_t>(row);
             const double s = at[static_cast<std::size_t>(column)];
             return SurfacePoint{beside(route, ground, s, profile[i].left, profile[i].up), {s, v[i]}};
           });
}

std::vector<Eigen::Vector2d> parallel_points(const Route& route, double begin, double end, double left,
                                             double step) {
  const Ground flat = [](double, double) { return 0.0; };
  const int count = std::max(1, static_cast<int>(std::ceil(std::abs(end - begin) / step)));
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i <= count; ++i) {
    points.push_back(beside(route, flat, begin + (end - begin) * i / count, left, 0.0).head<2>());
  }
  return points;
}

}  // namespace fdi_lio::simulation
