#include "mapping_optimization.hpp"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <utility>

#include "message_queue.hpp"
#include <sensor_msgs/PointCloud2.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include "fdi_lio/ros/odometry_message.hpp"

namespace fdi_lio::nodes {

namespace {

/// How long `reset` waits for a scan to begin anew with.
constexpr double kResetTimeoutS = 5.0;
/// How much longer than usual the first estimate waits for the IMU's node, which on a busy machine is heard
/// later than the others.
constexpr double kFirstAnswerS = 2.0;

/// Says something that matters also at the end of the process, when the log is closed already.
void tell(ros::console::levels::Level level, const std::string& text) {
  if (ros::ok()) {
    ROS_LOG(level, ROSCONSOLE_DEFAULT_NAME, "%s", text.c_str());
  } else {
    std::cerr << "mapping_optimization: " << text << std::endl;
  }
}

}  // namespace

void MappingOptimization::start() {
  imu_gate_.emplace(config().nodes.answer_timeout_s);
  degeneracy_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  frames_.emplace(config(), handle);
  status_publisher_ = handle.advertise<OptimisationStatus>("mapping/status", 50, true);
  state_publisher_ = handle.advertise<EstimatorState>("mapping/state", 50, true);
  odometry_publisher_ = handle.advertise<nav_msgs::Odometry>("odometry/lidar", 50);
  local_map_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("map/local", 1, true);
  reset_publisher_ = handle.advertise<std_msgs::Empty>("mapping/reset", 1);
  map_ = std::make_unique<MapFrame>(handle, config(), &*frames_, reporter(), !output_folder().empty());
  begin_recording();
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  scan_subscriber_ = handle.subscribe("scan/deskewed", kQueue, &MappingOptimization::on_scan, this, hints);
  preintegrated_subscriber_ =
      handle.subscribe("imu/preintegrated", kQueue, &MappingOptimization::on_preintegrated, this, hints);
  degeneracy_subscriber_ =
      handle.subscribe("degeneracy", kQueue, &MappingOptimization::on_degeneracy, this, hints);
  features_subscriber_ =
      handle.subscribe("features/all", kQueue, &MappingOptimization::on_features, this, hints);
  if (config().gnss.enabled)
    fix_subscriber_ =
        handle.subscribe(config().sensor.gnss_topic, kQueue, &MappingOptimization::on_fix, this, hints);
  if (config().external_odometry.enabled)
    external_odometry_subscriber_ = handle.subscribe(config().sensor.external_odometry_topic, kQueue,
                                                     &MappingOptimization::on_external_odometry, this, hints);
  services_ = std::make_unique<MapServices>(
      handle, config(),
      MapServices::Owner{[this] { return map_->snapshot(); }, [this] { request_reset(); },
                         [this](mapping::Session session) { return map_->load(std::move(session)); }});
}

MappingOptimization::~MappingOptimization() {
  is_ending_ = true;
  try {
    end_recording();
  } catch (const Error& error) {
    tell(ros::console::levels::Error, error.what());
  }
}

std::string MappingOptimization::output_folder() {
  return getPrivateNodeHandle().param("output", std::string());
}

void MappingOptimization::begin_recording() {
  times_ = evaluation::StageTimes();
  began_ = SteadyClock::now();
  const std::string output = output_folder();
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
  map_->write(directory_.get(), config().mapping.output_map_voxel_m);
  const double data_s = previous_scan_ ? seconds_between(first_scan_, *previous_scan_) : 0.0;
  directory_->write_timing(times_, seconds_since(began_), data_s);
  directory_->write_warnings(*reporter());
  tell(ros::console::levels::Info,
       std::to_string(directory_->scans()) + " scans; results in " + directory_->path().string());
  directory_.reset();
}

void MappingOptimization::begin_anew(Stamp stamp, const std::string& reason) {
  if (previous_scan_) {
    reporter()->report(Severity::kWarning, "restart",
                       reason + ": a new map is begun, what was recorded is saved");
    end_recording();
    begin_recording();
  }
  map_->begin_anew();
  features_.clear();
  previous_scan_.reset();
  imu_gate_->reset();
  degeneracy_gate_->reset();
  // What is said of the scan to begin with may have come before it.
  const auto answer = [stamp](const auto& queue, AnswerGate* gate) {
    for (const auto& message : queue) {
      const Stamp answered = ros_bridge::to_stamp(message->header.stamp);
      if (!is_jump(stamp, answered)) gate->answered(answered);
    }
  };
  answer(preintegrated_, &*imu_gate_);
  answer(degeneracies_, &*degeneracy_gate_);
  if (estimator_) estimator_->reset();
  imu_since_.reset();
  ++beginnings_;
}

/// A service has loaded a session: from here on the map is that one.
void MappingOptimization::begin_localising() {
  end_recording();
  begin_recording();
  first_scan_ = previous_scan_.value_or(0);
  map_->begin_anew();
}

void MappingOptimization::request_reset() {
  if (reset_publisher_.getNumSubscribers() == 0)
    throw Error("scan_deskew, which tells the others, does not run: nothing was reset");
  const std::uint64_t before = beginnings_;
  reset_publisher_.publish(std_msgs::Empty());
  const auto asked = SteadyClock::now();
  while (beginnings_ == before) {
    if (is_ending_ || !ros::ok()) throw Error("the node is ending");
    if (seconds_since(asked) > kResetTimeoutS)
      throw Error("the nodes begin anew with the next scan, but none has come yet");
    ros::WallDuration(0.01).sleep();
  }
}

void MappingOptimization::on_features(const FeaturesConstPtr& message) {
  const Stamp stamp = ros_bridge::to_stamp(message->header.stamp);
  if (previous_scan_ && is_jump(*previous_scan_, stamp)) {
    begin_anew(stamp, "the stamps of the scans jumped by " +
                          std::to_string(seconds_between(*previous_scan_, stamp)) + " s");
  } else if (message->begins_anew) {
    begin_anew(stamp, "a reset was asked for");
  }
  if (features_.empty()) front_since_ = SteadyClock::now();
  features_.push_back(message);
  if (features_.size() > kQueue) features_.pop_front();
  while (process_front()) {
  }
}

void MappingOptimization::on_fix(const sensor_msgs::NavSatFixConstPtr& message) {
  const mapping::GnssFix fix = ros_bridge::to_gnss_fix(*message);
  if (previous_scan_ && !is_jump(*previous_scan_, fix.stamp)) map_->add_fix(fix);
}

void MappingOptimization::on_external_odometry(const nav_msgs::OdometryConstPtr& message) {
  const mapping::ExternalPose pose = ros_bridge::to_external_pose(*message);
  if (previous_scan_ && !is_jump(*previous_scan_, pose.stamp)) map_->add_external(pose);
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

void MappingOptimization::on_scan(const DeskewedCloudConstPtr& message) { map_->add_cloud(message); }

bool MappingOptimization::prepare() {
  if (estimator_) return true;
  known_ = frames_->config_with_extrinsics(features_.front()->header.frame_id);
  if (!known_ || !frames_->T_base_imu()) return false;
  estimator_.emplace(*known_, reporter(), StageTimer([this](const std::string& stage, double duration_ms) {
    times_.add(stage, duration_ms);
  }));
  return true;
}

PreintegratedImuConstPtr MappingOptimization::take_preintegrated(const ros::Time& stamp) {
  PreintegratedImuConstPtr newest;
  while (!preintegrated_.empty() && preintegrated_.front()->header.stamp <= stamp) {
    newest = preintegrated_.front();
    preintegrated_.pop_front();
    if (!newest->available) {
      imu_since_.reset();
      continue;
    }
    const imu::Preintegration next = ros_bridge::to_preintegration(*newest);
    const bool follows =
        imu_since_ && imu_since_->to == next.from && imu_since_->sample_count > 0 && next.sample_count > 0;
    imu_since_ = follows ? imu::joined(*imu_since_, next) : next;
  }
  return newest && newest->header.stamp == stamp ? newest : nullptr;
}

bool MappingOptimization::process_front() {
  if (features_.empty() || !prepare()) return false;
  const ros::Time ros_stamp = features_.front()->header.stamp;
  const Stamp stamp = ros_bridge::to_stamp(ros_stamp);
  const double waited_s = seconds_since(front_since_);
  // A node that was restarted is told by the IMU's node where it was: it is worth a longer wait to hear it.
  const double imu_waited_s = estimator_->state() ? waited_s : waited_s - kFirstAnswerS;
  if (!imu_gate_->is_open(stamp, imu_waited_s) || !degeneracy_gate_->is_open(stamp, waited_s)) return false;
  const FeaturesConstPtr features = features_.front();
  features_.pop_front();
  const PreintegratedImuConstPtr preintegrated = take_preintegrated(ros_stamp);
  const DegeneracyConstPtr degeneracy = take(&degeneracies_, ros_stamp);
  // Nor may it begin with a scan of which the IMU's node spoke before it was heard.
  const bool is_before_answers = !preintegrated && !estimator_->state() && imu_gate_->has_answered(stamp);
  if (!is_before_answers) process(*features, preintegrated, degeneracy);
  // What came for the next while this one was worked on has not been read yet: its wait begins now.
  front_since_ = SteadyClock::now();
  return true;
}

void MappingOptimization::process(const Features& features, const PreintegratedImuConstPtr& preintegrated,
                                  const DegeneracyConstPtr& degeneracy) {
  const Stamp stamp = ros_bridge::to_stamp(features.header.stamp);
  try {
    if (preintegrated && preintegrated->has_state && !estimator_->state())
      estimator_->resume(ros_bridge::to_state(preintegrated->state));
    pipeline::ScanOutput output;
    output.features = ros_bridge::to_features(features);
    if (degeneracy) output.degeneracy = ros_bridge::to_degeneracy(*degeneracy);
    std::optional<imu::Preintegration> imu;
    if (preintegrated && preintegrated->available) imu = imu_since_;
    const auto begin = SteadyClock::now();
    const auto estimate = estimator_->add(output.features, output.degeneracy, imu);
    times_.add("mapping", 1e3 * seconds_since(begin));
    if (!estimate) {
      // The others wait for an answer also to a scan that was refused.
      if (const auto state = estimator_->state()) {
        odometry::EstimateResult unchanged;
        unchanged.state = *state;
        state_publisher_.publish(
            ros_bridge::to_state_message(unchanged, stamp, config().frames.odom, config().frames.imu));
      }
      return;
    }
    imu_since_.reset();
    output.estimate = *estimate;
    if (!previous_scan_) first_scan_ = stamp;
    previous_scan_ = stamp;
    publish(output, features.header.frame_id);
    if (directory_) directory_->add(output);
  } catch (const Error& error) {
    reporter()->report(Severity::kError, "scan_message", error.what());
  }
}

void MappingOptimization::publish(const pipeline::ScanOutput& output, const std::string& lidar_frame) {
  const odometry::EstimateResult& estimate = output.estimate;
  const FrameConfig& frames = config().frames;
  status_publisher_.publish(ros_bridge::to_status_message(estimate, frames.imu));
  const EstimatorStatePtr state =
      ros_bridge::to_state_message(estimate, estimate.state.stamp, frames.odom, frames.imu);
  state_publisher_.publish(state);
  odometry_publisher_.publish(ros_bridge::to_odometry(estimate.state, *frames_->T_base_imu(),
                                                      state->covariance, state->velocity_covariance,
                                                      config().sensor, frames));
  map_->add(estimate, output.features, *known_);
  frames_->publish_sensors(lidar_frame);
}

void MappingOptimization::publish_maps() {
  if (!estimator_ || !previous_scan_) return;
  const FrameConfig& frames = config().frames;
  if (local_map_publisher_.getNumSubscribers() > 0 &&
      seconds_since(local_map_at_) > config().nodes.local_map_period_s) {
    local_map_at_ = SteadyClock::now();
    local_map_publisher_.publish(ros_bridge::to_cloud(estimator_->local_map(), *previous_scan_, frames.odom));
  }
  map_->publish_map(*previous_scan_);
}

void MappingOptimization::check_waiting() {
  if (map_->has_loaded()) begin_localising();
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
  map_->fill_diagnostics(status);
  status->add("local map voxels", estimator_ ? estimator_->map_voxel_count() : 0);
  status->add("waits for the IMU that timed out", imu_gate_->timeouts());
  status->add("waits for the degeneracy that timed out", degeneracy_gate_->timeouts());
}

}  // namespace fdi_lio::nodes
