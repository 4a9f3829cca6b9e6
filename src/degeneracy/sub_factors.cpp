#include "fdi_lio/degeneracy/sub_factors.hpp"

#include <cmath>

namespace fdi_lio::degeneracy {

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }

double structural_sub_factor(const Metrics& metrics, const DegeneracyConfig& config) {
  const double monotony =
      logistic(config.complexity_gain * (config.complexity_centre - metrics.geometric_complexity));
  const double relative_deviation =
      metrics.plane_deviation_m / (metrics.plane_deviation_m + config.deviation_scale_m);
  const double roughness = logistic(config.deviation_gain * (relative_deviation - 0.5));
  return 1.0 - (1.0 - monotony) * (1.0 - roughness);
}

double sparse_sub_factor(const Metrics& metrics, const DegeneracyConfig& config) {
  double x = config.entropy_gain * (config.entropy_centre - metrics.point_entropy);
  if (metrics.has_gradient) x += config.gradient_gain * (config.gradient_centre - metrics.gradient_mean);
  return logistic(x);
}

double dynamic_sub_factor(const Metrics& metrics, const DegeneracyConfig& config) {
  double x = config.curvature_gain * (metrics.curvature_complexity - config.curvature_centre);
  if (metrics.has_gradient) {
    x += config.gradient_variation_gain * (metrics.gradient_variation - config.gradient_variation_centre);
  }
  return logistic(x);
}

std::array<double, 3> sub_factors(const Metrics& metrics, const DegeneracyConfig& config) {
  return {structural_sub_factor(metrics, config), sparse_sub_factor(metrics, config),
          dynamic_sub_factor(metrics, config)};
}

}  // namespace fdi_lio::degeneracy
