#include "fdi_lio/degeneracy/environment_classifier.hpp"

#include <algorithm>

#include "fdi_lio/degeneracy/sub_factors.hpp"

namespace fdi_lio::degeneracy {

namespace {

/// The odds of `u` set against those of `threshold`, as a share.
double relative_odds(double u, double threshold) {
  const double above = u * (1.0 - threshold);
  return above / (above + (1.0 - u) * threshold);
}

}  // namespace

std::array<double, 4> class_scores(const std::array<double, 3>& sub_factors, const DegeneracyConfig& config) {
  const double poor = std::max(sub_factors[kStructural], sub_factors[kSparseness]);
  const double f = relative_odds(poor, config.class_poor_threshold);
  const double d = relative_odds(sub_factors[kDynamics], config.class_dynamic_threshold);
  return {(1.0 - f) * (1.0 - d), f * (1.0 - d), (1.0 - f) * d, f * d};
}

EnvironmentClass EnvironmentClassifier::update(const std::array<double, 3>& sub_factors) {
  const std::array<double, 4> scores = class_scores(sub_factors, config_);
  const auto best = static_cast<std::size_t>(std::max_element(scores.begin(), scores.end()) - scores.begin());
  const auto winner = static_cast<EnvironmentClass>(best);
  if (!has_class_) {
    has_class_ = true;
    current_ = winner;
    return current_;
  }
  const bool passes =
      winner != current_ && scores[best] > scores[static_cast<std::size_t>(current_)] + config_.class_margin;
  if (!passes) {
    held_scans_ = 0;
    return current_;
  }
  held_scans_ = held_scans_ > 0 && winner == candidate_ ? held_scans_ + 1 : 1;
  candidate_ = winner;
  if (held_scans_ >= config_.class_hold_scans) {
    current_ = winner;
    held_scans_ = 0;
  }
  return current_;
}

}  // namespace fdi_lio::degeneracy
