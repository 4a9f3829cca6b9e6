#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Eigenvalues>

#include "fdi_lio/degeneracy/metrics.hpp"
#include "fdi_lio/degeneracy/sub_factors.hpp"

namespace fdi_lio::degeneracy {

double weakest_position_sigma_m(const Eigen::Matrix<double, 6, 6>& covariance) {
  const Eigen::Matrix3d position = covariance.bottomRightCorner<3, 3>();
  if (!position.allFinite()) return 0.0;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(position, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[2]));
}

DegeneracyEstimator::DegeneracyEstimator(const Config& config, Reporter* reporter)
    : config_(config),
      reporter_(reporter),
      voxels_(config.degeneracy),
      weights_(config.degeneracy),
      classifier_(config.degeneracy) {}

Degeneracy DegeneracyEstimator::estimate(const DeskewedScan& scan,
                                         const std::optional<OptimisationStatus>& status) {
  Degeneracy result;
  result.stamp = scan.stamp;
  result.metrics = measure(scan);
  add_knowledge(scan, status, &result.metrics);
  result.sub_factors = sub_factors(result.metrics, config_.degeneracy);
  if (is_new(scan.stamp)) {
    weights_.push(result.sub_factors);
    classifier_.update(result.sub_factors);
  }
  result.weights = weights_.weights();
  result.environment = classifier_.current();
  for (std::size_t k = 0; k < 3; ++k) result.fdi += result.weights[k] * result.sub_factors[k];
  result.fdi = std::min(1.0, result.fdi);  // against rounding
  if (status) copy_directions(*status, &result);
  return result;
}

Metrics DegeneracyEstimator::measure(const DeskewedScan& scan) {
  const DegeneracyConfig& config = config_.degeneracy;
  Metrics metrics;
  voxels_.build(scan);
  metrics.geometric_complexity = geometric_complexity(voxels_, config);
  metrics.plane_deviation_m = plane_deviation_m(scan, voxels_);
  metrics.point_entropy = point_entropy(voxels_, config);
  metrics.curvature_complexity =
      curvature_complexity(scan, voxels_.stride(), config_.sensor.range_noise_m, config);
  if (!scan.intensity_gradient.empty() && scan.intensity_gradient.size() != scan.points.size()) {
    report("degeneracy.gradient_size", "A scan's intensity gradient has " +
                                           std::to_string(scan.intensity_gradient.size()) + " entries for " +
                                           std::to_string(scan.points.size()) +
                                           " points. The degeneracy of this scan ignores intensity.");
  }
  const GradientStatistics gradient = gradient_statistics(scan, voxels_.stride(), config);
  metrics.has_gradient = gradient.valid;
  metrics.gradient_mean = gradient.mean;
  metrics.gradient_variation = gradient.variation;
  return metrics;
}

void DegeneracyEstimator::add_knowledge(const DeskewedScan& scan,
                                        const std::optional<OptimisationStatus>& status,
                                        Metrics* metrics) const {
  // The plain criterion also hits static silhouettes: what it removes says nothing of movement.
  metrics->has_moving_share = config_.dynamic.mode == "full";
  const std::size_t total = scan.points.size() + scan.removed.size();
  metrics->points = static_cast<std::uint32_t>(total);
  if (metrics->has_moving_share && total > 0)
    metrics->moving_share = static_cast<double>(scan.moving_count()) / static_cast<double>(total);
  if (status && std::isfinite(status->position_sigma_m))
    metrics->position_sigma_m = std::max(0.0, status->position_sigma_m);
}

bool DegeneracyEstimator::is_new(Stamp stamp) {
  if (!newest_stamp_ || stamp > *newest_stamp_) {
    newest_stamp_ = stamp;
    return true;
  }
  report("degeneracy.stale_scan", "A scan came twice or out of order, by " +
                                      std::to_string(seconds_between(stamp, *newest_stamp_)) +
                                      " s. Its degeneracy does not enter the history.");
  return false;
}

void DegeneracyEstimator::copy_directions(const OptimisationStatus& status, Degeneracy* result) {
  if (!status.axes.allFinite() || !status.localizability.allFinite()) {
    report("degeneracy.status_not_finite",
           "An optimisation status has values that are not finite. It is ignored.");
    return;
  }
  result->axes = status.axes;
  result->localizability = status.localizability.cwiseMax(0.0).cwiseMin(1.0);
}

void DegeneracyEstimator::report(const std::string& key, const std::string& text) {
  if (reporter_ != nullptr) reporter_->report(Severity::kWarning, key, text);
}

void DegeneracyEstimator::reset() {
  weights_ = InformationWeights(config_.degeneracy);
  classifier_ = EnvironmentClassifier(config_.degeneracy);
  newest_stamp_.reset();
}

}  // namespace fdi_lio::degeneracy
