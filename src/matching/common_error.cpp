#include "fdi_lio/matching/common_error.hpp"

#include <Eigen/LU>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::matching {

void add_common_error(double sigma_rad, LidarInformation* information) {
  const Matrix6d S = isotropic(sigma_rad, sigma_rad * information->radius_m);
  const Matrix6d keep = (Matrix6d::Identity() + information->H * S).inverse();
  const Matrix6d H = keep * information->H;
  information->H = 0.5 * (H + H.transpose());
  information->b = keep * information->b;
}

}  // namespace fdi_lio::matching
