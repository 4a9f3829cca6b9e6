#pragma once

#include <array>

#include "fdi_lio/degeneracy/degeneracy_config.hpp"
#include "fdi_lio/degeneracy/degeneracy_types.hpp"

namespace fdi_lio::degeneracy {

/// Places in `Degeneracy::sub_factors` and `Degeneracy::weights`.
enum SubFactor : std::size_t { kStructural = 0, kSparseness = 1, kDynamics = 2 };

/// 1 / (1 + exp(-x)), also for infinite x.
double logistic(double x);

/// Lack of clean, diverse structure in (0, 1): a low geometric complexity, a large plane deviation or a
/// direction in which mapping hardly knew the position is enough.
double structural_sub_factor(const Metrics& metrics, const DegeneracyConfig& config);

/// Lack of spread of the points, of intensity texture and of certainty in the weakest direction in (0, 1):
/// one makes up for the other.
double sparse_sub_factor(const Metrics& metrics, const DegeneracyConfig& config);

/// Unrest of the surroundings in (0, 1), from the variation of curvature and of the intensity gradient, and
/// from the share of points that move.
double dynamic_sub_factor(const Metrics& metrics, const DegeneracyConfig& config);

std::array<double, 3> sub_factors(const Metrics& metrics, const DegeneracyConfig& config);

}  // namespace fdi_lio::degeneracy
