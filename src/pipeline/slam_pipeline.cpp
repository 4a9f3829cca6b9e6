#include "fdi_lio/pipeline/slam_pipeline.hpp"

#include <utility>

#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include "fdi_lio/features/feature_extractor.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/imu/scan_interval.hpp"
#include "fdi_lio/scan/scan_processor.hpp"

namespace fdi_lio::pipeline {

class SlamPipeline::Implementation {
 public:
  Implementation(const Config& config, Reporter* reporter, OutputCallback on_output, TimingCallback on_timing)
      : config_(config),
        on_output_(std::move(on_output)),
        timer_(std::move(on_timing)),
        imu_(config.sensor, reporter),
        scan_processor_(config, reporter, timer_),
        extractor_(config, reporter),
        degeneracy_(config, reporter),
        estimator_(config, reporter, timer_) {}

  void add_imu(const imu::ImuSample& sample) {
    if (imu_.add(sample) == StampVerdict::kDrop) return;
    if (waiting_ && has_readings()) process_waiting();
  }

  void add_scan(Scan scan) {
    if (waiting_) process_waiting();
    waiting_ = std::move(scan);
    if (has_readings()) process_waiting();
  }

  void finish() {
    if (waiting_) process_waiting();
  }

 private:
  bool has_readings() const {
    const auto state = estimator_.state();
    return imu_.reaches(waiting_->stamp, state ? state->lidar_time_offset_s : 0.0);
  }

  void process_waiting() {
    Scan scan = std::move(*waiting_);
    waiting_.reset();
    ScanOutput output;
    output.scan = scan_processor_.process(std::move(scan), estimator_.state(), imu_);
    timer_.timed_together(
        "features", [&] { output.features = extractor_.extract(output.scan, previous_); },  //
        "degeneracy", [&] { output.degeneracy = degeneracy_.estimate(output.scan, status_); });
    const auto imu = timer_.timed("preintegration", [&] {
      return imu::preintegrate_scan_interval(imu_, estimator_.state(), std::nullopt, output.scan.stamp,
                                             config_);
    });
    const auto estimate =
        timer_.timed("mapping", [&] { return estimator_.add(output.features, output.degeneracy, imu); });
    if (!estimate) return;
    previous_ = output.degeneracy;
    status_ = estimate->status;
    status_->position_sigma_m = degeneracy::weakest_position_sigma_m(estimate->map_covariance);
    output.estimate = *estimate;
    // The longest stretch that is asked for again: the next interval, or the statistics before the next scan.
    imu_.drop_before(add_seconds(output.scan.stamp, -2.0 * config_.imu.static_duration_s));
    on_output_(std::move(output));
  }

  Config config_;
  OutputCallback on_output_;
  StageTimer timer_;
  imu::ImuBuffer imu_;
  scan::ScanProcessor scan_processor_;
  features::FeatureExtractor extractor_;
  degeneracy::DegeneracyEstimator degeneracy_;
  odometry::Estimator estimator_;
  degeneracy::Degeneracy previous_;
  std::optional<degeneracy::OptimisationStatus> status_;
  std::optional<Scan> waiting_;
};

SlamPipeline::SlamPipeline(const Config& config, Reporter* reporter, OutputCallback on_output,
                           TimingCallback on_timing)
    : implementation_(
          std::make_unique<Implementation>(config, reporter, std::move(on_output), std::move(on_timing))) {}
SlamPipeline::~SlamPipeline() = default;

void SlamPipeline::add_imu(const imu::ImuSample& sample) { implementation_->add_imu(sample); }
void SlamPipeline::add_scan(Scan scan) { implementation_->add_scan(std::move(scan)); }
void SlamPipeline::finish() { implementation_->finish(); }

}  // namespace fdi_lio::pipeline
