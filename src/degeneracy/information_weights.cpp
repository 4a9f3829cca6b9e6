#include "fdi_lio/degeneracy/information_weights.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::degeneracy {

double entropy(const std::vector<double>& p) {
  double sum = 0.0;
  for (const double share : p) {
    if (share > 0.0) sum -= share * std::log(share);
  }
  return sum;
}

double kl_divergence(const std::vector<double>& p, const std::vector<double>& q) {
  double sum = 0.0;
  for (std::size_t b = 0; b < p.size(); ++b) {
    if (p[b] > 0.0) sum += p[b] * std::log(p[b] / q[b]);
  }
  return std::max(0.0, sum);
}

std::vector<double> reference_distribution(std::size_t bins, double scale) {
  std::vector<double> q(bins);
  double sum = 0.0;
  for (std::size_t b = 0; b < bins; ++b) {
    q[b] = std::exp(-(static_cast<double>(b) + 0.5) / (static_cast<double>(bins) * scale));
    sum += q[b];
  }
  for (double& share : q) share /= sum;
  return q;
}

std::vector<double> parse_reference(const std::string& text, const std::string& parameter, std::size_t bins,
                                    double scale) {
  if (text.find_first_not_of(" \t\n") == std::string::npos) return reference_distribution(bins, scale);
  std::istringstream stream(text);
  std::vector<double> q;
  double sum = 0.0;
  for (double share = 0.0; stream >> share;) {
    if (!(share > 0.0 && std::isfinite(share))) break;
    q.push_back(share);
    sum += share;
  }
  if (!stream.eof() || q.size() != bins) {
    throw Error("parameter '" + parameter + "' is \"" + text + "\", but must be " + std::to_string(bins) +
                " positive numbers with blanks between them, one for each of degeneracy.histogram_bins: "
                "scripts/learn_reference.py writes them (--bins)");
  }
  for (double& share : q) share /= sum;
  return q;
}

SlidingHistogram::SlidingHistogram(std::size_t bins, std::size_t window, double smoothing)
    : window_(window), smoothing_(smoothing), counts_(bins, 0) {}

void SlidingHistogram::push(double value) {
  const double scaled = std::clamp(value, 0.0, 1.0) * static_cast<double>(counts_.size());
  const std::size_t bin = std::min(static_cast<std::size_t>(scaled), counts_.size() - 1);
  values_.push_back(bin);
  ++counts_[bin];
  if (values_.size() > window_) {
    --counts_[values_.front()];
    values_.pop_front();
  }
}

std::vector<double> SlidingHistogram::distribution() const {
  const double total = static_cast<double>(values_.size()) + smoothing_ * static_cast<double>(counts_.size());
  std::vector<double> p(counts_.size());
  for (std::size_t b = 0; b < p.size(); ++b) p[b] = (static_cast<double>(counts_[b]) + smoothing_) / total;
  return p;
}

InformationWeights::InformationWeights(const DegeneracyConfig& config)
    : config_(config),
      histograms_(
          3, SlidingHistogram(static_cast<std::size_t>(config.histogram_bins),
                              static_cast<std::size_t>(config.window_scans), config.histogram_smoothing)) {
  const auto reference = [&config](const std::string& text, const char* parameter) {
    return parse_reference(text, parameter, static_cast<std::size_t>(config.histogram_bins),
                           config.reference_scale);
  };
  references_ = {reference(config.reference_structural, "degeneracy.reference_structural"),
                 reference(config.reference_sparse, "degeneracy.reference_sparse"),
                 reference(config.reference_dynamic, "degeneracy.reference_dynamic")};
}

void InformationWeights::push(const std::array<double, 3>& sub_factors) {
  for (std::size_t k = 0; k < 3; ++k) histograms_[k].push(sub_factors[k]);
}

std::array<double, 3> InformationWeights::weights() const {
  const double largest_entropy = std::log(static_cast<double>(config_.histogram_bins));
  std::array<double, 3> weights{};
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::vector<double> p = histograms_[k].distribution();
    const double certainty = std::max(0.0, 1.0 - entropy(p) / largest_entropy);
    const double largest = -std::log(*std::min_element(references_[k].begin(), references_[k].end()));
    const double divergence = kl_divergence(p, references_[k]) / largest;
    weights[k] =
        config_.weight_floor + config_.weight_entropy * certainty + config_.weight_divergence * divergence;
    sum += weights[k];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

}  // namespace fdi_lio::degeneracy
