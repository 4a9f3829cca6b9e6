#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"

namespace fdi_lio::degeneracy {

DegeneracyEstimator::DegeneracyEstimator(const Config& config, Reporter* reporter)
    : config_(config), reporter_(reporter) {}

Degeneracy DegeneracyEstimator::estimate(const DeskewedScan& scan, const FeatureSet& /*features*/,
                                         const std::optional<OptimisationStatus>& status) {
  Degeneracy degeneracy;
  degeneracy.stamp = scan.stamp;
  if (status) {
    degeneracy.axes = status->axes;
    degeneracy.localizability = status->localizability;
  }
  return degeneracy;
}

void DegeneracyEstimator::reset() {}

}  // namespace fdi_lio::degeneracy
