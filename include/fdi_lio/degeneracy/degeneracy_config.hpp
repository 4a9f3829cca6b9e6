#pragma once

#include <string>

#include "fdi_lio/common/parameter_visitor.hpp"

namespace fdi_lio::degeneracy {

/// Reference distributions that ship with the package (learned_reference.cpp says how they were learned).
extern const char* const kLearnedStructural;
extern const char* const kLearnedSparse;
extern const char* const kLearnedDynamic;

/// Parameters of the degeneracy estimate. docs/degeneracy.md names each symbol.
struct DegeneracyConfig {
  int max_samples = 16000;
  double voxel_m = 1.0;
  double voxel_growth_range_m = 20.0;
  int voxel_min_points = 6;
  int voxel_min_ring_span = 1;
  double orientation_share = 0.75;
  int entropy_reference_voxels = 100;
  int curvature_neighbours = 5;
  double curvature_half_width_m = 0.5;
  double curvature_floor = 0.3;
  double gradient_floor = 0.05;
  double gradient_percentile = 0.99;

  double complexity_gain = 5.0;
  double complexity_centre = 0.53;
  double deviation_gain = 25.0;
  double deviation_scale_m = 0.055;
  double entropy_gain = 10.0;
  double entropy_centre = 0.82;
  double gradient_gain = 3.0;
  double gradient_centre = 0.2;
  double curvature_gain = 0.2;
  double curvature_centre = 2.5;
  double gradient_variation_gain = 0.2;
  double gradient_variation_centre = 1.0;
  double moving_gain = 1.5;
  double moving_centre = 0.3;
  double uncertainty_structural_gain = 1.2;
  double uncertainty_sparse_gain = 5.0;
  double uncertainty_centre_m = 0.004;

  int window_scans = 50;
  int histogram_bins = 10;
  double histogram_smoothing = 0.5;
  std::string reference_structural = kLearnedStructural;
  std::string reference_sparse = kLearnedSparse;
  std::string reference_dynamic = kLearnedDynamic;
  double reference_scale = 0.3;
  double weight_entropy = 0.3;
  double weight_divergence = 1.0;
  double weight_floor = 0.3;

  int class_hold_scans = 5;
  double class_margin = 0.1;
  double class_poor_threshold = 0.73;
  double class_dynamic_threshold = 0.05;

  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio::degeneracy
