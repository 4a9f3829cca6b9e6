#include "fdi_lio/scan/ground_plane.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Geometry>

namespace fdi_lio::scan {

namespace {

/// Enough to hit a plane with a tenth of the points four times.
constexpr int kSamples = 4000;
constexpr float kBelowM = 0.3F;
/// What lies so near belongs to the plane: the ground is not even.
constexpr float kThicknessM = 0.1F;

}  // namespace

Plane find_plane(const std::vector<Eigen::Vector3f>& points, const Eigen::Vector3d& axis,
                 double max_angle_rad) {
  Plane best;
  if (points.size() < 3) return best;
  std::mt19937 random(1);
  const auto draw = [&]() -> Eigen::Vector3d { return points[random() % points.size()].cast<double>(); };
  const double min_cosine = std::cos(max_angle_rad);
  std::size_t most = 0;
  for (int sample = 0; sample < kSamples; ++sample) {
    const Eigen::Vector3d a = draw();
    const Eigen::Vector3d b = draw();
    const Eigen::Vector3d c = draw();
    Eigen::Vector3d normal = (b - a).cross(c - a);
    const double area = normal.norm();
    if (area < 1e-3) continue;  // nearly on one line
    normal /= normal.dot(a) > 0.0 ? -area : area;
    if (normal.dot(axis) < min_cosine) continue;
    const double distance_m = -normal.dot(a);
    const Eigen::Vector3f n = normal.cast<float>();
    const auto d = static_cast<float>(distance_m);
    std::size_t count = 0;
    for (const Eigen::Vector3f& point : points) count += std::abs(n.dot(point) + d) < kThicknessM ? 1 : 0;
    if (count <= most) continue;
    most = count;
    best.normal = normal;
    best.distance_m = distance_m;
  }
  const auto n = best.normal.cast<float>();
  const auto lowest = -static_cast<float>(best.distance_m) - kBelowM;
  const auto below = std::count_if(points.begin(), points.end(),
                                   [&](const Eigen::Vector3f& point) { return n.dot(point) < lowest; });
  best.share = static_cast<double>(most) / static_cast<double>(points.size());
  best.below = static_cast<double>(below) / static_cast<double>(points.size());
  return best;
}

}  // namespace fdi_lio::scan
