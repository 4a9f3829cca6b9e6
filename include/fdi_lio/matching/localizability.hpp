#pragma once

#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::matching {

/// Which directions of motion the matched residuals of one scan observe.
///
/// The tangent is s = [L dtheta, dt_c]: the rotation in IMU axes times the root mean square distance L of the
/// matched features from their centroid, and the shift of that centroid in IMU axes. Both are metres, so that
/// rotations and translations compare, whatever the size of the place and wherever the sensor stands in it.
struct Localizability {
  /// Columns: unit directions in s, eigenvectors of the information in s, the best observed first.
  Matrix6d axes = Matrix6d::Identity();
  /// Information along each axis, of the residuals and what their noise alone would give [1/m^2].
  Vector6d information = Vector6d::Zero();
  Vector6d noise_information = Vector6d::Zero();
  /// Probability that the lidar observes each axis.
  Vector6d probability = Vector6d::Ones();
};

/// p_k = Phi((u_k' H u_k - u_k' E u_k) / sd_k) after Hatleskog and Alexis, "Probabilistic Degeneracy
/// Detection for Point-to-Plane Error Minimization" (RA-L 2024, arXiv 2410.10784). E is `noise_information`:
/// what errors of the map's normals and intensity gradients add to H without any real constraint, times
/// `margin`. With N independent residuals of similar size sd_k^2 = (2 e_k^2 + 4 h_k e_k) / N, h and e being
/// the two terms above (e is chi-square, and h varies with its cross terms). All axes have probability 1 when
/// nothing was matched or H is not finite.
Localizability analyse_localizability(const LidarInformation& information, double margin);

/// Scales the information along each axis with its probability, and the gradient alike: the step that the
/// lidar alone would take stays the same, but in weak directions the motion prior outweighs it (a soft prior
/// of weight 1 - p_k; non-linear Tikhonov regularisation, Tuna et al., arXiv 2408.11809). Axes with
/// probability 1 keep their information.
void soften(const Localizability& localizability, LidarInformation* information);

/// Takes the bias out of the gradient. The bias changes with the pose by `noise_information`, so that the
/// slope of what is left is h_k - f_k e_k along axis k: f_k = min(1, 0.9 h_k / e_k) keeps it positive where
/// the errors are smaller than they are taken for.
void remove_bias(const Localizability& localizability, LidarInformation* information);

/// Adds residuals of another kind where the first leave a direction open: their information and gradient are
/// projected with P = sum_k (1 - p_k) u_k u_k' in s. Textures know where one is along a smooth wall, but
/// their errors are larger and less independent than those of geometry: where geometry is sure, they are left
/// out.
void add_in_weak_directions(const Localizability& localizability, const LidarInformation& further,
                            LidarInformation* information);

}  // namespace fdi_lio::matching
