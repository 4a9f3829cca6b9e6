#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "map_frame.hpp"
#include "node_base.hpp"
#include "sensor_frames.hpp"
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/Empty.h>

#include "fdi_lio/common/answer_gate.hpp"
#include "fdi_lio/evaluation/stage_times.hpp"
#include "fdi_lio/odometry/estimator.hpp"
#include "fdi_lio/pipeline/run_directory.hpp"
#include <fdi_lio/Degeneracy.h>
#include <fdi_lio/DeskewedCloud.h>
#include <fdi_lio/Features.h>
#include <fdi_lio/PreintegratedImu.h>

namespace fdi_lio::nodes {

/// mapping_optimization: joins features, degeneracy and preintegrated IMU of one scan, estimates, and
/// publishes state, odometry and the local map; what belongs to `map` is in MapFrame. What does not come in
/// time is done without: no IMU means constant velocity, no degeneracy the neutral value. With `~output`
/// every run leaves the same files as offline_slam, in a folder of its own.
class MappingOptimization : public NodeBase {
 public:
  ~MappingOptimization() override;

 protected:
  void start() override;
  void check_waiting() override;
  void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) override;

 private:
  void on_features(const FeaturesConstPtr& message);
  void on_degeneracy(const DegeneracyConstPtr& message);
  void on_preintegrated(const PreintegratedImuConstPtr& message);
  void on_scan(const DeskewedCloudConstPtr& message);
  void on_fix(const sensor_msgs::NavSatFixConstPtr& message);
  void on_external_odometry(const nav_msgs::OdometryConstPtr& message);
  bool prepare();
  bool process_front();
  void process(const Features& features, const PreintegratedImuConstPtr& preintegrated,
               const DegeneracyConstPtr& degeneracy);
  /// The message for the scan. Joins the readings since the newest estimate, when scans between were lost on
  /// their way here, or that estimate came too late for imu_preintegration to begin at it.
  PreintegratedImuConstPtr take_preintegrated(const ros::Time& stamp);
  void request_reset();
  std::string output_folder();
  void begin_recording();
  void end_recording();
  void begin_anew(Stamp stamp, const std::string& reason);
  void begin_localising();
  void publish(const pipeline::ScanOutput& output, const std::string& lidar_frame);
  void publish_maps();

  std::optional<Config> known_;  ///< parameters with the extrinsics that tf may have supplied
  std::optional<odometry::Estimator> estimator_;
  std::optional<AnswerGate> imu_gate_, degeneracy_gate_;
  std::optional<SensorFrames> frames_;
  std::optional<Stamp> previous_scan_;
  std::deque<FeaturesConstPtr> features_;
  std::deque<DegeneracyConstPtr> degeneracies_;
  std::deque<PreintegratedImuConstPtr> preintegrated_;
  std::optional<imu::Preintegration> imu_since_;  ///< the newest estimate
  SteadyClock::time_point front_since_;

  std::unique_ptr<pipeline::RunDirectory> directory_;
  std::atomic<std::uint64_t> beginnings_{0};  ///< how often this node began anew
  std::atomic<bool> is_ending_{false};
  evaluation::StageTimes times_;
  Stamp first_scan_ = 0;
  SteadyClock::time_point began_;
  SteadyClock::time_point local_map_at_;

  ros::Subscriber features_subscriber_, degeneracy_subscriber_, preintegrated_subscriber_, scan_subscriber_,
      fix_subscriber_, external_odometry_subscriber_;
  ros::Publisher status_publisher_, state_publisher_, odometry_publisher_, local_map_publisher_,
      reset_publisher_;
  std::unique_ptr<MapFrame> map_;
  std::unique_ptr<MapServices> services_;  ///< last: its thread uses what is above
};

}  // namespace fdi_lio::nodes
