#pragma once

#include <vector>

#include "fdi_lio/simulation/mesh.hpp"
#include "fdi_lio/simulation/route.hpp"

namespace fdi_lio::simulation {

/// A point of a cross-section: metres to the left of the route and above the ground at the route.
struct ProfilePoint {
  double left = 0.0;
  double up = 0.0;
};

/// Position beside a route: `s` along, `left` of it, `up` above the ground at the route.
Eigen::Vector3d beside(const Route& route, const Ground& ground, double s, double left, double up);

/// Pose with x along the route at the same place.
Eigen::Isometry3d pose_beside(const Route& route, const Ground& ground, double s, double left, double up);

/// Arc lengths from `begin` to `end` at most `step` apart.
std::vector<double> stations(double begin, double end, double step);

/// Surface that a cross-section sweeps along a route. Texture: u is the arc length, v the length along the
/// profile from `v_origin`.
void sweep(Mesh* mesh, const Route& route, const Ground& ground, const std::vector<double>& stations,
           const std::vector<ProfilePoint>& profile, MaterialId material, double v_origin = 0.0);

/// A route parallel to `route`, `left` metres to its left, as corner points `step` metres apart from `begin`
/// to `end` (backwards if end < begin).
std::vector<Eigen::Vector2d> parallel_points(const Route& route, double begin, double end, double left,
                                             double step);

}  // namespace fdi_lio::simulation
