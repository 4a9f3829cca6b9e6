#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/evaluation/stage_times.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/localisation/localiser.hpp"
#include "fdi_lio/mapping/global_worker.hpp"
#include "fdi_lio/mapping/keyframe.hpp"
#include "fdi_lio/pipeline/run_directory.hpp"
#include "fdi_lio/pipeline/slam_pipeline.hpp"

namespace fdi_lio::tools {

/// The pipeline over one recording, with its results in a folder. Like the nodes it drops scans whose stamps
/// do not follow, and begins anew where stamps jump for good (a recording that was started again, a clock
/// that was set): the results from there on go to OUTPUT_2, OUTPUT_3, ... The map is made in a thread of its
/// own, which changes no result. With `localisation.session` no map is made: the poses are those in the
/// session.
class SlamRun {
 public:
  /// Makes the folder `output`. Throws Error when it cannot be made or written, or when the session to
  /// localise in is damaged.
  SlamRun(const Config& config, const std::string& output, Reporter* reporter);

  /// Tells the localiser where the recording begins.
  void set_initial_pose(const localisation::InitialPose& pose);

  void add_imu(const imu::ImuSample& sample);

  void add_fix(const mapping::GnssFix& fix) { part_->global.add_fix(fix); }

  void add_external(const mapping::ExternalPose& pose) { part_->global.add_external(pose); }

  /// Throws Error when the disk takes no more.
  void add_scan(Scan scan);

  /// Notes how long a stage took.
  void add_timing(const std::string& stage, double ms) { part_->times.add(stage, ms); }

  /// Notes how much of the recording has been read.
  void advance(double position_s) { position_s_ = position_s; }

  /// Processes what waits and writes map, timing and warnings. Throws Error when the disk takes no more.
  void finish();

  /// Whether the place in the session was found, if there was one to localise in.
  bool is_placed() const { return !part_->localiser || !part_->localised.empty(); }

  /// Scans with an estimate.
  std::size_t scans() const { return finished_scans_ + part_->directory.scans(); }

 private:
  /// What lies between two jumps.
  struct Part {
    Part(const Config& config, const std::string& output, double begin_s, Reporter* reporter);

    void add(pipeline::ScanOutput output);
    void add_to_map(std::function<mapping::Keyframe()> make);
    void localise(const mapping::Keyframe& scan);

    Config config;
    double begin_s;  ///< position in the recording
    std::chrono::steady_clock::time_point began = std::chrono::steady_clock::now();
    pipeline::RunDirectory directory;
    mapping::KeyframeMaker keyframes;  ///< used by the thread of `global`, else by that of the localiser
    mapping::GlobalWorker global;
    std::unique_ptr<localisation::Localiser> localiser;  ///< in place of `global`
    std::vector<evaluation::StampedPose> localised;  ///< T_map_imu of every scan since the place was found
    std::vector<localisation::LocalisationResult> registrations;
    evaluation::StageTimes times;
    pipeline::SlamPipeline pipeline;
  };

  void begin_anew();
  void write_map();

  Config config_;
  std::string output_;
  Reporter* reporter_;
  StampGuard guard_;
  std::unique_ptr<Part> part_;
  int parts_ = 1;
  std::size_t finished_scans_ = 0;
  double position_s_ = 0.0;
};

}  // namespace fdi_lio::tools
