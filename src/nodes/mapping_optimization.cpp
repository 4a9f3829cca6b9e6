#include "mapping_optimization.hpp"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <utility>

#include <sensor_msgs/PointCloud2.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/imu/propagation.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include "fdi_lio/ros/odometry_message.hpp"

namespace fdi_lio::nodes {

namespace {

constexpr std::size_t kQueue = 50;
/// map -> odom is stamped ahead, so that it can be combined with an odom -> base_link that is newer than the
/// last scan.
constexpr double kMapTransformAheadS = 0.5;

/// The message of `queue` for `stamp`; drops what is older.
template <typename Message>
Message take(std::deque<Message>* queue, const ros::Time& stamp) {
  while (!queue->empty() && queue->front()->header.stamp < stamp) queue->pop_front();
  if (queue->empty() || queue->front()->header.stamp != stamp) return nullptr;
  Message message = queue->front();
  queue->pop_front();
  return message;
}

template <typename Message>
void keep(const Message& message, std::deque<Message>* queue) {
  // Stamps that go back are those of a recording that was started again.
  if (!queue->empty() && message->header.stamp < queue->back()->header.stamp) queue->clear();
  queue->push_back(message);
  if (queue->size() > kQueue) queue->pop_front();
}

/// Says something that matters also at the end of the process, when the log is closed already.
void tell(ros::console::levels::Level level, const std::string& text) {
  if (ros::ok()) {
    ROS_LOG(level, ROSCONSOLE_DEFAULT_NAME, "%s", text.c_str());
  } else {
    std::cerr << "mapping_optimization: " << text << std::endl;
  }
}

geometry_msgs::Pose to_pose(const Eigen::Isometry3d& T) {
  geometry_msgs::Pose pose;
  const Eigen::Quaterniond q(T.rotation());
  pose.position.x = T.translation().x();
  pose.position.y = T.translation().y();
  pose.position.z = T.translation().z();
  pose.orientation.x = q.x();
  pose.orientation.y = q.y();
  pose.orientation.z = q.z();
  pose.orientation.w = q.w();
  return pose;
}

}  // namespace

void MappingOptimization::start() {
  imu_gate_.emplace(config().nodes.answer_timeout_s);
  degeneracy_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  frames_.emplace(config(), handle);
  broadcaster_.emplace();
  status_publisher_ = handle.advertise<OptimisationStatus>("mapping/status", 50, true);
  state_publisher_ = handle.advertise<EstimatorState>("mapping/state", 50, true);
  odometry_publisher_ = handle.advertise<nav_msgs::Odometry>("odometry/lidar", 50);
  path_publisher_ = handle.advertise<nav_msgs::Path>("path", 1, true);
  keyframes_publisher_ = handle.advertise<geometry_msgs::PoseArray>("keyframes", 1, true);
  local_map_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("map/local", 1, true);
  global_map_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("map/global", 1, true);
  begin_recording();
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  scan_subscriber_ = handle.subscribe("scan/deskewed", kQueue, &MappingOptimization::on_scan, this, hints);
  preintegrated_subscriber_ =
      handle.subscribe("imu/preintegrated", kQueue, &MappingOptimization::on_preintegrated, this, hints);
  degeneracy_subscriber_ =
      handle.subscribe("degeneracy", kQueue, &MappingOptimization::on_degeneracy, this, hints);
  features_subscriber_ =
      handle.subscribe("features/all", kQueue, &MappingOptimization::on_features, this, hints);
}

MappingOptimization::~MappingOptimization() {
  try {
    end_recording();
  } catch (const Error& error) {
    tell(ros::console::levels::Error, error.what());
  }
}

void MappingOptimization::begin_recording() {
  global_.reset();  // made when the extrinsics are known
  display_ = std::make_unique<mapping::MapBuilder>(config().nodes.global_map_voxel_m);
  path_ = nav_msgs::Path();
  path_.header.frame_id = config().frames.map;
  times_ = evaluation::StageTimes();
  began_ = SteadyClock::now();
  const std::string output = getPrivateNodeHandle().param("output", std::string());
  if (output.empty()) return;
  std::string path = output;
  // A node that was restarted must not write over what it left.
  for (int k = 2; std::filesystem::exists(path + "/trajectory.tum"); ++k)
    path = output + "_" + std::to_string(k);
  directory_ = std::make_unique<pipeline::RunDirectory>(path, config());
  NODELET_INFO("recording to %s", path.c_str());
}

void MappingOptimization::end_recording() {
  if (!directory_) return;
  take_keyframe_clouds();
  if (global_) directory_->write_global(global_->finish(), config().mapping.output_map_voxel_m);
  const double data_s = previous_scan_ ? seconds_between(first_scan_, *previous_scan_) : 0.0;
  directory_->write_timing(times_, seconds_since(began_), data_s);
  directory_->write_warnings(*reporter());
  tell(ros::console::levels::Info,
       std::to_string(directory_->scans()) + " scans; results in " + directory_->path().string());
  directory_.reset();
}

void MappingOptimization::begin_anew(Stamp stamp) {
  reporter()->report(Severity::kWarning, "restart",
                     "the stamps of the scans jumped by " +
                         std::to_string(seconds_between(*previous_scan_, stamp)) +
                         " s: a new map is begun, what was recorded is saved");
  end_recording();
  begin_recording();
  features_.clear();
  keyframes_.clear();
  previous_scan_.reset();
  imu_gate_->reset();
  degeneracy_gate_->reset();
  estimator_->reset();
}

void MappingOptimization::on_features(const FeaturesConstPtr& message) {
  const Stamp stamp = ros_bridge::to_stamp(message->header.stamp);
  if (previous_scan_ && is_jump(*previous_scan_, stamp)) begin_anew(stamp);
  if (features_.empty()) front_since_ = SteadyClock::now();
  features_.push_back(message);
  if (features_.size() > kQueue) features_.pop_front();
  while (process_front()) {
  }
}

void MappingOptimization::on_degeneracy(const DegeneracyConstPtr& message) {
  keep(message, &degeneracies_);
  degeneracy_gate_->answered(ros_bridge::to_stamp(message->header.stamp));
  while (process_front()) {
  }
}

void MappingOptimization::on_preintegrated(const PreintegratedImuConstPtr& message) {
  keep(message, &preintegrated_);
  imu_gate_->answered(ros_bridge::to_stamp(message->header.stamp));
  while (process_front()) {
  }
}

void MappingOptimization::on_scan(const DeskewedCloudConstPtr& message) {
  keep(message, &scans_);
  take_keyframe_clouds();
}

bool MappingOptimization::prepare() {
  if (estimator_) return true;
  known_ = frames_->config_with_extrinsics(features_.front()->header.frame_id);
  if (!known_ || !frames_->T_base_imu()) return false;
  estimator_.emplace(*known_, reporter());
  return true;
}

void MappingOptimization::resume(const PreintegratedImu& message) {
  const imu::NavState before = ros_bridge::to_state(message.state);
  const Stamp stamp = ros_bridge::to_stamp(message.header.stamp);
  // A state from long ago says nothing about where the robot is now.
  if (before.stamp >= stamp || is_jump(before.stamp, stamp)) return;
  const bool has_imu = before.imu_status == imu::ImuStatus::kInitialised && message.available &&
                       message.sample_count > 0 && message.begin == message.state.header.stamp;
  estimator_->resume(has_imu ? imu::predict(before, ros_bridge::to_preintegration(message))
                             : imu::coast(before, stamp));
}

bool MappingOptimization::process_front() {
  if (features_.empty() || !prepare()) return false;
  const ros::Time ros_stamp = features_.front()->header.stamp;
  const Stamp stamp = ros_bridge::to_stamp(ros_stamp);
  const double waited_s = seconds_since(front_since_);
  if (!imu_gate_->is_open(stamp, waited_s) || !degeneracy_gate_->is_open(stamp, waited_s)) return false;
  const FeaturesConstPtr features = features_.front();
  features_.pop_front();
  front_since_ = SteadyClock::now();
  const PreintegratedImuConstPtr preintegrated = take(&preintegrated_, ros_stamp);
  const DegeneracyConstPtr degeneracy = take(&degeneracies_, ros_stamp);
  try {
    if (preintegrated && preintegrated->has_state && !estimator_->state()) resume(*preintegrated);
    pipeline::ScanOutput output;
    output.features = ros_bridge::to_features(*features);
    if (degeneracy) output.degeneracy = ros_bridge::to_degeneracy(*degeneracy);
    std::optional<imu::Preintegration> imu;
    if (preintegrated && preintegrated->available) imu = ros_bridge::to_preintegration(*preintegrated);
    const auto begin = SteadyClock::now();
    const auto estimate = estimator_->add(output.features, output.degeneracy, imu);
    times_.add("mapping", 1e3 * seconds_since(begin));
    if (!estimate) {
      // The others wait for an answer also to a scan that was refused.
      if (const auto state = estimator_->state()) {
        mapping::EstimateResult unchanged;
        unchanged.state = *state;
        state_publisher_.publish(
            ros_bridge::to_state_message(unchanged, stamp, config().frames.odom, config().frames.imu));
      }
      return true;
    }
    output.estimate = *estimate;
    if (!previous_scan_) first_scan_ = stamp;
    previous_scan_ = stamp;
    publish(output, features->header.frame_id);
    if (directory_) directory_->add(output);
  } catch (const Error& error) {
    reporter()->report(Severity::kError, "scan_message", error.what());
  }
  return true;
}

void MappingOptimization::publish(const pipeline::ScanOutput& output, const std::string& lidar_frame) {
  const mapping::EstimateResult& estimate = output.estimate;
  const FrameConfig& frames = config().frames;
  status_publisher_.publish(ros_bridge::to_status_message(estimate, frames.imu));
  const EstimatorStatePtr state =
      ros_bridge::to_state_message(estimate, estimate.state.stamp, frames.odom, frames.imu);
  state_publisher_.publish(state);
  odometry_publisher_.publish(ros_bridge::to_odometry(estimate.state, *frames_->T_base_imu(),
                                                      state->covariance, state->velocity_covariance,
                                                      config().sensor, frames));
  if (frames.publish_tf) {
    geometry_msgs::TransformStamped T_map_odom;
    T_map_odom.header.stamp = state->header.stamp + ros::Duration(kMapTransformAheadS);
    T_map_odom.header.frame_id = frames.map;
    T_map_odom.child_frame_id = frames.odom;
    if (global_) {
      const geometry_msgs::Pose correction = to_pose(global_->T_map_odom());
      T_map_odom.transform.translation.x = correction.position.x;
      T_map_odom.transform.translation.y = correction.position.y;
      T_map_odom.transform.translation.z = correction.position.z;
      T_map_odom.transform.rotation = correction.orientation;
    } else {
      T_map_odom.transform.rotation.w = 1.0;
    }
    broadcaster_->sendTransform(T_map_odom);
  }
  if (estimate.is_keyframe) add_keyframe(estimate, output.features);
  frames_->publish_sensors(lidar_frame);
}

void MappingOptimization::add_keyframe(const mapping::EstimateResult& estimate, const FeatureSet& features) {
  if (!global_) global_ = std::make_unique<mapping::GlobalWorker>(*known_);
  keyframes_.push_back({estimate, features});
  take_keyframe_clouds();
  geometry_msgs::PoseStamped pose;
  pose.header.stamp = ros_bridge::to_ros_time(estimate.state.stamp);
  pose.header.frame_id = config().frames.map;
  pose.pose = to_pose(global_->T_map_odom() * estimate.state.T_odom_imu() * frames_->T_base_imu()->inverse());
  path_.header.stamp = pose.header.stamp;
  path_.poses.push_back(pose);
  if (path_.poses.size() > static_cast<std::size_t>(config().nodes.path_poses)) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < path_.poses.size(); k += 2) path_.poses[kept++] = path_.poses[k];
    path_.poses.resize(kept);
  }
  path_publisher_.publish(path_);
  geometry_msgs::PoseArray keyframes;
  keyframes.header = path_.header;
  for (const geometry_msgs::PoseStamped& each : path_.poses) keyframes.poses.push_back(each.pose);
  keyframes_publisher_.publish(keyframes);
}

void MappingOptimization::take_keyframe_clouds() {
  while (!keyframes_.empty()) {
    const ros::Time stamp = ros_bridge::to_ros_time(keyframes_.front().estimate.state.stamp);
    const DeskewedCloudConstPtr scan = take(&scans_, stamp);
    if (!scan && scans_.empty()) return;  // it has yet to come
    if (scan) {
      const std::vector<Point> points = ros_bridge::to_points(scan->points);
      const mapping::EstimateResult& estimate = keyframes_.front().estimate;
      const Eigen::Isometry3d T_imu_lidar = known_->sensor.T_imu_lidar();
      const Eigen::Isometry3d T_odom_imu = estimate.state.T_odom_imu();
      global_->add({estimate.state.stamp, T_odom_imu, estimate.map_covariance,
                    mapping::make_keyframe_cloud(points, keyframes_.front().features, T_imu_lidar,
                                                 config().mapping.output_map_voxel_m)});
      display_->add(points, global_->T_map_odom() * T_odom_imu * T_imu_lidar);
    }
    keyframes_.pop_front();
  }
}

void MappingOptimization::publish_maps() {
  if (!estimator_ || !previous_scan_) return;
  const FrameConfig& frames = config().frames;
  if (local_map_publisher_.getNumSubscribers() > 0 &&
      seconds_since(local_map_at_) > config().nodes.local_map_period_s) {
    local_map_at_ = SteadyClock::now();
    local_map_publisher_.publish(ros_bridge::to_cloud(estimator_->local_map(), *previous_scan_, frames.odom));
  }
  if (global_map_publisher_.getNumSubscribers() > 0 &&
      seconds_since(global_map_at_) > config().nodes.global_map_period_s) {
    global_map_at_ = SteadyClock::now();
    global_map_publisher_.publish(ros_bridge::to_cloud(display_->points(), *previous_scan_, frames.map));
  }
}

void MappingOptimization::check_waiting() {
  while (process_front()) {
  }
  publish_maps();
  if (imu_gate_->take_timeout())
    reporter()->report(Severity::kWarning, "imu_silent",
                       "imu_preintegration does not answer: motion is predicted by constant velocity");
  if (degeneracy_gate_->take_timeout())
    reporter()->report(Severity::kWarning, "degeneracy_silent",
                       "degeneracy_estimation does not answer: the neutral degeneracy is used");
}

void MappingOptimization::fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) {
  status->add("waiting scans", features_.size());
  status->add("keyframes", path_.poses.size());
  status->add("keyframes that wait for loop search", global_ ? global_->backlog() : 0);
  if (global_ && !global_->error().empty()) status->add("global map stopped", global_->error());
  status->add("local map voxels", estimator_ ? estimator_->map_voxel_count() : 0);
  status->add("waits for the IMU that timed out", imu_gate_->timeouts());
  status->add("waits for the degeneracy that timed out", degeneracy_gate_->timeouts());
}

}  // namespace fdi_lio::nodes
