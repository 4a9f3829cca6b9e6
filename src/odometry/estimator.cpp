#include "fdi_lio/odometry/estimator.hpp"

#include <iomanip>
#include <sstream>
#include <utility>

#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/odometry/imu_start.hpp"
#include "fdi_lio/odometry/scan_estimator.hpp"

namespace fdi_lio::odometry {

Estimator::Estimator(const Config& config, Reporter* reporter, StageTimer timer)
    : config_(config),
      reporter_(reporter),
      timer_(std::move(timer)),
      scans_(std::make_unique<ScanEstimator>(config, reporter, timer_)),
      review_(config) {}
Estimator::~Estimator() = default;

std::optional<EstimateResult> Estimator::add(const FeatureSet& features,
                                             const degeneracy::Degeneracy& degeneracy,
                                             const std::optional<imu::Preintegration>& imu) {
  EstimatorInput input;
  input.features = features;
  input.degeneracy = degeneracy;
  input.imu = imu;
  if (const auto before = state()) input.v_deskew = before->v_odom;
  if (!review_) return scans_->add(std::move(input), false);
  std::optional<EstimateResult> result =
      stands_upright(input) ? add_to_review(std::move(input)) : begin_upright(std::move(input));
  if (!result) return result;
  const bool is_initialised = result->state.imu_status == imu::ImuStatus::kInitialised;
  const std::optional<MovingStart> motion =
      is_initialised ? scans_->aligned_start() : review_->find_motion(scans_->has_found_motion());
  if (motion) result = begin_moving(*motion);
  const bool is_late = review_->inputs().size() > ImuStart::most_intervals(config_.imu);
  const bool awaits_alignment = imu && !is_late;
  if (motion || is_initialised || (review_->is_over() && !awaits_alignment)) review_.reset();
  return result;
}

std::optional<EstimateResult> Estimator::add_to_review(EstimatorInput input) {
  std::optional<EstimateResult> result = scans_->add(input, true);
  if (result) review_->add(std::move(input), result->state, result->position_information());
  return result;
}

/// False where `input` has the first readings, and scans came before them: `odom` is as the IMU was mounted.
bool Estimator::stands_upright(const EstimatorInput& input) const {
  const bool has_readings = input.imu && input.imu->recent.count > 0;
  if (!has_readings || review_->inputs().empty()) return true;
  const std::optional<imu::Preintegration>& first = review_->inputs().front().imu;
  return first && first->recent.count > 0;
}

/// All scans since the start once more, the first one upright by the readings that have come since.
std::optional<EstimateResult> Estimator::begin_upright(EstimatorInput newest) {
  std::vector<EstimatorInput> inputs = review_->inputs();
  inputs.push_back(std::move(newest));
  EstimatorInput& first = inputs.front();
  if (!first.imu) {
    first.imu.emplace();
    first.imu->from = first.imu->to = first.features.stamp;
  }
  first.imu->recent = inputs.back().imu->recent;
  const Eigen::Quaterniond q_odom_before = imu::level_orientation(first.imu->recent);
  scans_ = std::make_unique<ScanEstimator>(config_, reporter_, timer_);
  review_.emplace(config_);
  std::optional<EstimateResult> result;
  std::vector<imu::NavState> revised;
  for (EstimatorInput& input : inputs) {
    input.v_deskew = q_odom_before * input.v_deskew;
    result = add_to_review(std::move(input));
    if (result) revised.push_back(result->state);
  }
  if (!result) return result;
  revised.pop_back();
  result->revised = std::move(revised);
  return result;
}

/// All scans since the start once more, now with its velocity.
EstimateResult Estimator::begin_moving(const MovingStart& motion) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the first " << review_->inputs().size()
       << " scans were estimated anew, started at about " << motion.v_odom.norm() << " m/s";
  reporter_->report(Severity::kInfo, "start_motion", text.str());
  scans_ = std::make_unique<ScanEstimator>(config_, reporter_, timer_);
  scans_->begin_moving(motion);
  EstimateResult result;
  std::vector<imu::NavState> revised;
  for (const EstimatorInput& input : review_->inputs()) {
    if (const auto again = scans_->add(input, true)) result = *again;
    revised.push_back(result.state);
  }
  revised.pop_back();
  result.revised = std::move(revised);
  return result;
}

void Estimator::resume(const imu::NavState& state) {
  review_.reset();
  scans_->resume(state);
}

std::optional<imu::NavState> Estimator::state() const { return scans_->state(); }
std::vector<Point> Estimator::local_map() const { return scans_->local_map(); }
std::size_t Estimator::map_voxel_count() const { return scans_->map_voxel_count(); }

void Estimator::reset() {
  scans_ = std::make_unique<ScanEstimator>(config_, reporter_, timer_);
  review_.emplace(config_);
}

}  // namespace fdi_lio::odometry
