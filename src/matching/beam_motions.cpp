#include "fdi_lio/matching/beam_motions.hpp"

namespace fdi_lio::matching {

Eigen::Matrix<double, 3, 2> beam_motions(const Eigen::Vector3d& beam_m, const Eigen::Vector3d& spin_axis) {
  const double up_m = beam_m.dot(spin_axis);
  const Eigen::Vector3d level = beam_m - up_m * spin_axis;
  const double level_m = level.norm();
  Eigen::Matrix<double, 3, 2> motions = Eigen::Matrix<double, 3, 2>::Zero();
  if (level_m < 1e-3) return motions;
  motions.col(0) = beam_m / beam_m.norm();
  motions.col(1) = level_m * spin_axis - up_m / level_m * level;
  return motions;
}

}  // namespace fdi_lio::matching
