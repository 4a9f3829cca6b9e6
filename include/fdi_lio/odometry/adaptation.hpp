#pragma once

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"

namespace fdi_lio::odometry {

/// How one scan is matched.
struct AdaptedSettings {
  int iterations = 1;                ///< association rounds
  double feature_voxel_m = 0.0;      ///< downsampling of the features
  double plane_weight = 0.0;         ///< factor on the information of plane matches
  double edge_weight = 0.0;          ///< factor on the information of edge matches
  double noise_scale = 1.0;          ///< factor on the covariance of the odometry, at least 1
  double keyframe_distance_m = 0.0;  ///< motion beyond which a scan is a keyframe
};

/// Settings of the scan whose degeneracy is given, from the parameters `mapping.*`. With F = FDI (clamped to
/// [0, 1]; 0 when not finite) and the class:
///   feature_voxel_m     = v_0 (1 + voxel_gain (1 - 2 F))             larger in structured surroundings
///   iterations          = round(N_base (1 + iterations_gain F))
///   plane_weight        = w_p (1 + plane_gain [structured])
///   edge_weight         = w_e (1 + edge_gain [sparse])
///   noise_scale         = 1 + noise_gain F
///   keyframe_distance_m = (tau_0 exp(-keyframe_decay F) + keyframe_least_distance_m) (1 - keyframe_gain F)
/// Each line holds while its switch is on; off, it is v_0, N_base, w_p and w_e, 1 and tau_0.
AdaptedSettings adapt(const AdaptationConfig& config, const MappingConfig& base,
                      const degeneracy::Degeneracy& degeneracy);

}  // namespace fdi_lio::odometry
