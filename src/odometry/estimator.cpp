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
  const std::optional<EstimateResult> result =
      lies_after_first_reading(input) ? begin_upright(std::move(input)) : add_to_review(std::move(input));
  if (!result) return result;
  const bool is_initialised = result->state.imu_status == imu::ImuStatus::kInitialised;
  // What feels no more than at rest may move smoothly.
  const bool seems_to_stand = scans_->seems_to_stand();
  const bool is_aligned = is_initialised && !seems_to_stand;
  const std::optional<MovingStart> motion =
      is_aligned ? scans_->aligned_start() : review_->find_motion(scans_->has_found_motion(), seems_to_stand);
  if (motion) return begin_moving(*motion);
  const bool is_late = review_->inputs().size() > ImuStart::most_intervals(config_.imu);
  const bool awaits_alignment = imu && !is_initialised && !is_late;
  if (is_aligned || (review_->is_over() && !awaits_alignment)) review_.reset();
  return result;
}

/// While the review lasts, it gets the scan as well.
std::optional<EstimateResult> Estimator::add_to_review(EstimatorInput input) {
  std::optional<EstimateResult> result = scans_->add(input, true);
  if (result && review_) review_->add(std::move(input), result->state, result->position_information());
  return result;
}

/// `input` has the first readings, and scans came before them: `odom` is as the IMU is mounted.
bool Estimator::lies_after_first_reading(const EstimatorInput& input) const {
  const auto has_readings = [](const EstimatorInput& one) { return one.imu && one.imu->recent.count > 0; };
  const std::vector<EstimatorInput>& before = review_->inputs();
  return has_readings(input) && !before.empty() && !has_readings(before.front()) &&
         before.back().features.stamp < input.features.stamp;
}

/// All scans since the start once more, the first one upright by the readings that have come since.
EstimateResult Estimator::begin_upright(EstimatorInput newest) {
  std::vector<EstimatorInput> inputs = review_->inputs();
  reporter_->report(Severity::kInfo, "late_imu",
                    "the first " + std::to_string(inputs.size()) +
                        " scans came before the first IMU reading, and were estimated anew");
  inputs.push_back(std::move(newest));
  EstimatorInput& first = inputs.front();
  if (!first.imu) {
    first.imu.emplace();
    first.imu->from = first.imu->to = first.features.stamp;
  }
  first.imu->recent = inputs.back().imu->recent;
  const Eigen::Quaterniond q_odom_before = imu::level_orientation(first.imu->recent);
  for (EstimatorInput& input : inputs) input.v_deskew = q_odom_before * input.v_deskew;
  scans_ = std::make_unique<ScanEstimator>(config_, reporter_, timer_);
  review_.emplace(config_);
  return add_again(std::move(inputs));
}

/// All scans since the start once more, now with its velocity, which ends the review.
EstimateResult Estimator::begin_moving(const MovingStart& motion) {
  std::vector<EstimatorInput> inputs = review_->inputs();
  review_.reset();
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the first " << inputs.size()
       << " scans were estimated anew, started at about " << motion.v_odom.norm() << " m/s";
  reporter_->report(Severity::kInfo, "start_motion", text.str());
  scans_ = std::make_unique<ScanEstimator>(config_, reporter_, timer_);
  scans_->begin_moving(motion);
  return add_again(std::move(inputs));
}

/// Scans that have been added before, one of which may have to be a keyframe now. Returns the newest.
EstimateResult Estimator::add_again(std::vector<EstimatorInput> inputs) {
  EstimateResult result;
  std::vector<imu::NavState> revised;
  bool is_keyframe = false;
  for (EstimatorInput& input : inputs) {
    if (const auto again = add_to_review(std::move(input))) result = *again;
    is_keyframe = is_keyframe || result.is_keyframe;
    revised.push_back(result.state);
  }
  revised.pop_back();
  result.is_keyframe = is_keyframe;
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
