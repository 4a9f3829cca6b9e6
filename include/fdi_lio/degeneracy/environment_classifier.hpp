#pragma once

#include <array>

#include "fdi_lio/degeneracy/degeneracy_config.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"

namespace fdi_lio::degeneracy {

/// Scores of the classes in the order of EnvironmentClass; not negative, sum 1.
/// With f = o(max(structural, sparse), class_poor_threshold), d = o(dynamic, class_dynamic_threshold) and
/// o(u, t) = u (1 - t) / (u (1 - t) + (1 - u) t), which is 1/2 at the threshold: (1-f)(1-d), f(1-d), (1-f)d,
/// f d.
std::array<double, 4> class_scores(const std::array<double, 3>& sub_factors, const DegeneracyConfig& config);

/// Class of the surroundings with hysteresis: the first scan decides at once; later another class must win
/// with `class_margin` over the present one for `class_hold_scans` scans in a row.
class EnvironmentClassifier {
 public:
  explicit EnvironmentClassifier(const DegeneracyConfig& config) : config_(config) {}

  EnvironmentClass update(const std::array<double, 3>& sub_factors);
  EnvironmentClass current() const { return current_; }

 private:
  DegeneracyConfig config_;
  bool has_class_ = false;
  EnvironmentClass current_ = EnvironmentClass::kStructured;
  EnvironmentClass candidate_ = EnvironmentClass::kStructured;
  int held_scans_ = 0;
};

}  // namespace fdi_lio::degeneracy
