#include "fdi_lio/odometry/adaptation.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::odometry {

void AdaptationConfig::visit(ParameterVisitor& v) {
  v.flag(
      {"adaptation.voxel", "", "larger feature voxels in structured, smaller ones in degraded surroundings"},
      voxel);
  v.real(
      {"adaptation.voxel_gain", "", "share by which the feature voxel grows at FDI 0 and shrinks at FDI 1"},
      voxel_gain, 0.0, 0.9);
  v.flag({"adaptation.iterations", "", "more association rounds in degraded surroundings"}, iterations);
  v.real({"adaptation.iterations_gain", "", "beta: N_iter = N_base (1 + beta FDI)"}, iterations_gain, 0.0,
         10.0);
  v.flag({"adaptation.weights", "", "planes weigh more in structured, edges in sparse surroundings"},
         weights);
  v.real({"adaptation.plane_gain", "", "by how much more planes weigh in structured surroundings"},
         plane_gain, 0.0, 10.0);
  v.real({"adaptation.edge_gain", "", "by how much more edges weigh in sparse surroundings"}, edge_gain, 0.0,
         10.0);
  v.flag({"adaptation.noise", "", "larger covariance of the odometry in degraded surroundings"}, noise);
  v.real({"adaptation.noise_gain", "", "gamma: Sigma = Sigma_base (1 + gamma FDI)"}, noise_gain, 0.0, 100.0);
  v.flag({"adaptation.keyframes", "", "denser keyframes in degraded surroundings"}, keyframes);
  v.real({"adaptation.keyframe_decay", "", "nu: tau_kf = tau_0 exp(-nu FDI) + dT_min"}, keyframe_decay, 0.0,
         10.0);
  v.real({"adaptation.keyframe_gain", "", "delta: a keyframe needs a motion of tau_kf (1 - delta FDI)"},
         keyframe_gain, 0.0, 1.0);
  v.real(
      {"adaptation.keyframe_least_distance", "m", "dT_min: part of tau_kf that does not depend on the FDI"},
      keyframe_least_distance_m, 0.0, 10.0);
}

AdaptedSettings adapt(const AdaptationConfig& config, const MappingConfig& base,
                      const degeneracy::Degeneracy& degeneracy) {
  const double fdi = std::isfinite(degeneracy.fdi) ? std::clamp(degeneracy.fdi, 0.0, 1.0) : 0.0;
  AdaptedSettings settings;
  settings.iterations = base.base_iterations;
  settings.feature_voxel_m = base.feature_voxel_m;
  settings.plane_weight = base.plane_weight;
  settings.edge_weight = base.edge_weight;
  settings.keyframe_distance_m = base.keyframe_distance_m;
  if (config.voxel) settings.feature_voxel_m *= 1.0 + config.voxel_gain * (1.0 - 2.0 * fdi);
  if (config.iterations) {
    const double iterations = base.base_iterations * (1.0 + config.iterations_gain * fdi);
    settings.iterations = static_cast<int>(std::lround(iterations));
  }
  if (config.weights && degeneracy.environment == degeneracy::EnvironmentClass::kStructured)
    settings.plane_weight *= 1.0 + config.plane_gain;
  if (config.weights && degeneracy.environment == degeneracy::EnvironmentClass::kSparse)
    settings.edge_weight *= 1.0 + config.edge_gain;
  if (config.noise) settings.noise_scale = 1.0 + config.noise_gain * fdi;
  if (config.keyframes) {
    const double tau_m =
        base.keyframe_distance_m * std::exp(-config.keyframe_decay * fdi) + config.keyframe_least_distance_m;
    settings.keyframe_distance_m = tau_m * (1.0 - config.keyframe_gain * fdi);
  }
  return settings;
}

}  // namespace fdi_lio::odometry
