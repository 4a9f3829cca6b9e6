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
  bool range_profile = true;
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
  bool smoothing = false;
  double process_noise = 0.01;
  double measurement_noise = 0.1;

  void visit(ParameterVisitor& visitor);
};

/// Points that hang in the air (scan::find_isolated).
struct IsolationConfig {
  int min_neighbours = 2;
  double reach_m = 0.2;
  double reach_columns = 15.0;

  void visit(ParameterVisitor& visitor);
};

/// The filter of moving points (scan::DynamicFilter).
struct DynamicConfig {
  std::string mode = "full";  // off | plain | full
  double gradient_deviations = 2.0;
  double range_jump = 0.02;
  double safety_factor = 1.5;
  int past_scans = 5;
  double past_spacing_s = 0.5;
  double free_margin_m = 0.3;
  double free_margin_share = 0.01;
  double touch_distance_m = 0.3;
  double touch_share = 0.01;
  int min_object_points = 3;
  double max_static_share = 0.5;

  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio::scan
