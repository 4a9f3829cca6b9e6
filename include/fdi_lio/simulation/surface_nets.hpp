#pragma once

#include <functional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/simulation/mesh.hpp"

namespace fdi_lio::simulation {

/// Signed distance in metres, positive in rock, negative in the open.
using SignedDistance = std::function<double(const Eigen::Vector3d&)>;

/// Adds the zero surface of `distance` within `bounds` as a mesh of cells of `cell` metres (naive surface
/// nets: one vertex a cell that the surface crosses, at the mean of its edge crossings). The function must
/// not change by more than its argument moves, up to a factor of 2: cells far from the surface are skipped in
/// blocks.
void add_surface(Mesh* mesh, const SignedDistance& distance, const Eigen::AlignedBox3d& bounds, double cell,
                 MaterialId material);

}  // namespace fdi_lio::simulation
