#pragma once

#include <array>
#include <deque>
#include <string>
#include <vector>

#include "fdi_lio/degeneracy/degeneracy_config.hpp"

namespace fdi_lio::degeneracy {

/// H = -sum p ln p in nat, with 0 ln 0 = 0.
double entropy(const std::vector<double>& p);

/// D_KL(p || q) = sum p ln(p / q) in nat. Every q_b must be positive where p_b is.
double kl_divergence(const std::vector<double>& p, const std::vector<double>& q);

/// Distribution over `bins` equal bins of [0, 1], proportional to exp(-x / scale) at the middle of each.
std::vector<double> reference_distribution(std::size_t bins, double scale);

/// Reference distribution that `text` gives as numbers for its bins: all positive; they are divided by their
/// sum. An empty text gives `reference_distribution(bins, scale)`. Throws Error, which names `parameter`,
/// when a number is not positive and finite or when their count is not `bins`.
std::vector<double> parse_reference(const std::string& text, const std::string& parameter, std::size_t bins,
                                    double scale);

/// Histogram over [0, 1] of the newest `window` values, with `smoothing` counts in each bin beforehand.
class SlidingHistogram {
 public:
  SlidingHistogram(std::size_t bins, std::size_t window, double smoothing);

  /// Adds a value (clamped to [0, 1]); the oldest one leaves when the window is full.
  void push(double value);
  /// Shares of the bins; positive, sum 1, uniform before the first value.
  std::vector<double> distribution() const;
  std::size_t size() const { return values_.size(); }

 private:
  std::size_t window_;
  double smoothing_;
  std::vector<std::size_t> counts_;
  std::deque<std::size_t> values_;  ///< bins of the values, oldest first
};

/// Weights of the sub-factors by the information of their recent history.
class InformationWeights {
 public:
  /// Throws Error when a reference distribution of `config` does not fit.
  explicit InformationWeights(const DegeneracyConfig& config);

  void push(const std::array<double, 3>& sub_factors);
  /// Positive, sum 1; equal before the first scan.
  std::array<double, 3> weights() const;

 private:
  DegeneracyConfig config_;
  std::array<std::vector<double>, 3> references_;  ///< q_k
  std::vector<SlidingHistogram> histograms_;
};

}  // namespace fdi_lio::degeneracy
