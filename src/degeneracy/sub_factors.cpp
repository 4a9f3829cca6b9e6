#include "fdi_lio/degeneracy/sub_factors.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::degeneracy {

namespace {

/// A share below this is no more than mistakes of the filter of moving points.
constexpr double kLeastMovingShare = 1e-3;
/// Beyond this factor (e^3 = 20) a standard deviation is as good or as bad as it can be.
constexpr double kLargestLogarithm = 3.0;

/// ln(sigma / centre), bounded; 0 while sigma is unknown.
double uncertainty(const Metrics& metrics, const DegeneracyConfig& config) {
  if (!(metrics.position_sigma_m > 0.0)) return 0.0;
  const double logarithm = std::log(metrics.position_sigma_m / config.uncertainty_centre_m);
  return std::clamp(logarithm, -kLargestLogarithm, kLargestLogarithm);
}

}  // namespace

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }

double structural_sub_factor(const Metrics& metrics, const DegeneracyConfig& config) {
  const double monotony =
      logistic(config.complexity_gain * (config.complexity_centre - metrics.geometric_complexity));
  const double relative_deviation =
      metrics.plane_deviation_m / (metrics.plane_deviation_m + config.deviation_scale_m);
  const double roughness = logistic(config.deviation_gain * (relative_deviation - 0.5));
  const bool is_known = metrics.position_sigma_m > 0.0;
  const double weakness =
      is_known ? logistic(config.uncertainty_structural_gain * uncertainty(metrics, config)) : 0.0;
  return 1.0 - (1.0 - monotony) * (1.0 - roughness) * (1.0 - weakness);
}

double sparse_sub_factor(const Metrics& metrics, const DegeneracyConfig& config) {
  double x = config.entropy_gain * (config.entropy_centre - metrics.point_entropy);
  if (metrics.has_gradient) x += config.gradient_gain * (config.gradient_centre - metrics.gradient_mean);
  x += config.uncertainty_sparse_gain * uncertainty(metrics, config);
  return logistic(x);
}

double dynamic_sub_factor(const Metrics& metrics, const DegeneracyConfig& config) {
  double x = config.curvature_gain * (metrics.curvature_complexity - config.curvature_centre);
  if (metrics.has_gradient) {
    x += config.gradient_variation_gain * (metrics.gradient_variation - config.gradient_variation_centre);
  }
  if (metrics.has_moving_share) {
    x += config.moving_gain * std::log((metrics.moving_share + kLeastMovingShare) / config.moving_centre);
  }
  return logistic(x);
}

std::array<double, 3> sub_factors(const Metrics& metrics, const DegeneracyConfig& config) {
  return {structural_sub_factor(metrics, config), sparse_sub_factor(metrics, config),
          dynamic_sub_factor(metrics, config)};
}

}  // namespace fdi_lio::degeneracy
