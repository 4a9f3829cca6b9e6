#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "node_base.hpp"
#include "sensor_frames.hpp"
#include <geometry_msgs/PoseArray.h>
#include <nav_msgs/Path.h>
#include <tf2_ros/transform_broadcaster.h>

#include "fdi_lio/common/answer_gate.hpp"
#include "fdi_lio/evaluation/stage_times.hpp"
#include "fdi_lio/mapping/estimator.hpp"
#include "fdi_lio/mapping/global_worker.hpp"
#include "fdi_lio/mapping/map_builder.hpp"
#include "fdi_lio/pipeline/run_directory.hpp"
#include <fdi_lio/Degeneracy.h>
#include <fdi_lio/DeskewedCloud.h>
#include <fdi_lio/Features.h>
#include <fdi_lio/PreintegratedImu.h>

namespace fdi_lio::nodes {

/// mapping_optimization: joins features, degeneracy and preintegrated IMU of one scan, estimates, and
/// publishes state, odometry, path, keyframes, maps and tf map -> odom. What does not come in time is done
/// without: no IMU means constant velocity, no degeneracy the neutral value. With `~output` every run leaves
/// the same files as offline_slam, in a folder of its own.
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
  bool prepare();
  bool process_front();
  void begin_recording();
  void end_recording();
  void begin_anew(Stamp stamp);
  void resume(const PreintegratedImu& message);
  void publish(const pipeline::ScanOutput& output, const std::string& lidar_frame);
  void add_keyframe(const mapping::EstimateResult& estimate, const FeatureSet& features);
  void take_keyframe_clouds();
  void publish_maps();

  std::optional<Config> known_;  ///< parameters with the extrinsics that tf may have supplied
  std::optional<mapping::Estimator> estimator_;
  std::optional<AnswerGate> imu_gate_, degeneracy_gate_;
  std::optional<SensorFrames> frames_;
  std::optional<tf2_ros::TransformBroadcaster> broadcaster_;
  std::optional<Stamp> previous_scan_;
  std::deque<FeaturesConstPtr> features_;
  std::deque<DegeneracyConstPtr> degeneracies_;
  std::deque<PreintegratedImuConstPtr> preintegrated_;
  std::deque<DeskewedCloudConstPtr> scans_;
  struct WaitingKeyframe {
    mapping::EstimateResult estimate;
    FeatureSet features;
  };
  std::deque<WaitingKeyframe> keyframes_;  ///< whose clouds have not come yet
  SteadyClock::time_point front_since_;

  std::unique_ptr<pipeline::RunDirectory> directory_;
  std::unique_ptr<mapping::GlobalWorker> global_;
  std::unique_ptr<mapping::MapBuilder> display_;  ///< what is shown
  evaluation::StageTimes times_;
  Stamp first_scan_ = 0;
  SteadyClock::time_point began_;
  SteadyClock::time_point local_map_at_, global_map_at_;
  nav_msgs::Path path_;

  ros::Subscriber features_subscriber_, degeneracy_subscriber_, preintegrated_subscriber_, scan_subscriber_;
  ros::Publisher status_publisher_, state_publisher_, odometry_publisher_, path_publisher_,
      keyframes_publisher_, local_map_publisher_, global_map_publisher_;
};

}  // namespace fdi_lio::nodes
