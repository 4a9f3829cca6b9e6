#pragma once

#include <string>

#include "fdi_lio/common/parameter_visitor.hpp"

namespace fdi_lio::scan {

/// Making intensity comparable (scan::IntensityModel). docs/method.md names each symbol.
struct IntensityConfig {
  bool enabled = true;
  double range_exponent = 0.0;
  double incidence_exponent = 0.0;
  double reference_range_m = 10.0;
  bool beam_gains = true;
  double rescale_factor = 6.0;
  int rescale_scans = 10;

  void visit(ParameterVisitor& visitor);
};

/// The intensity gradient and its smoothing over time (scan::IntensityGradient, scan::GradientSmoother).
struct GradientConfig {
  std::string neighbourhood = "adaptive";  // adaptive | knn | radius
  int fine_neighbours = 5;
  int coarse_neighbours = 20;
  double fine_radius_m = 0.5;
  double coarse_radius_m = 2.0;
  double sample_spacing_m = 0.1;
  bool smoothing = true;
  double process_noise = 0.01;
  double measurement_noise = 0.1;

  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio::scan
