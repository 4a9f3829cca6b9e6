#pragma once

#include <string>

#include "fdi_lio/common/parameter_visitor.hpp"

namespace fdi_lio::localisation {

/// Localisation in a saved session.
struct LocalisationConfig {
  std::string session;
  double period_s = 1.0;
  double distance_m = 2.0;
  double search_period_s = 1.0;
  int search_candidates = 4;
  double submap_radius_m = 25.0;
  double initial_sigma_translation_m = 2.0;
  double initial_sigma_rotation_deg = 10.0;
  int confirmations = 2;
  double confirm_distance_m = 2.0;
  double confirm_time_s = 3.0;
  double ambiguity = 0.9;
  double min_fit = 0.53;
  int max_failures = 5;

  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio::localisation
