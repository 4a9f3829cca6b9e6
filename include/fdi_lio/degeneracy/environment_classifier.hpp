#pragma once

#include <array>

#include "fdi_lio/degeneracy/degeneracy_config.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"

namespace fdi_lio::degeneracy {

/// Scores of the classes in the order of EnvironmentClass; not negative, sum 1.
/// With f = max(structural, sparse) and d = dynamic: (1-f)(1-d), f(1-d), (1-f)d, f d.
std::array<double, 4> class_scores(const std::array<double, 3>& sub_factors);

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
