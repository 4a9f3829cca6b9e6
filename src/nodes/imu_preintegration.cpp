#include "imu_preintegration.hpp"

#include <utility>

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/scan_interval.hpp"
#include "fdi_lio/odometry/estimate_result.hpp"
#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include "fdi_lio/ros/odometry_message.hpp"
#include <fdi_lio/PreintegratedImu.h>

namespace fdi_lio::nodes {

namespace {
constexpr double kKeptReadingsS = 30.0;
}

void ImuPreintegration::start() {
  imu_.emplace(config().sensor, reporter());
  state_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  frames_.emplace(config(), handle);
  odometry_publisher_ = handle.advertise<nav_msgs::Odometry>("odometry/imu", 200);
  preintegration_publisher_ = handle.advertise<PreintegratedImu>("imu/preintegrated", 50);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  if (!config().sensor.imu_topic.empty())
    imu_subscriber_ =
        handle.subscribe(config().sensor.imu_topic, 2000, &ImuPreintegration::on_imu, this, hints);
  state_subscriber_ = handle.subscribe("mapping/state", 50, &ImuPreintegration::on_state, this, hints);
  scan_subscriber_ = handle.subscribe("scan/info", 50, &ImuPreintegration::on_scan, this, hints);
}

void ImuPreintegration::on_imu(const sensor_msgs::ImuConstPtr& message) {
  frames_->learn_imu_frame(message->header.frame_id);
  const StampVerdict verdict = imu_->add(ros_bridge::to_imu_sample(*message));
  if (verdict == StampVerdict::kDrop) return;
  if (verdict == StampVerdict::kRestart) propagator_.reset();
  const imu::ImuSample& sample = imu_->samples().back();
  if (const auto state = propagator_.add(sample)) publish_odometry(*state);
  imu_->drop_before(add_seconds(sample.stamp, -kKeptReadingsS));
  while (answer_front()) {
  }
}

void ImuPreintegration::on_state(const EstimatorStateConstPtr& message) {
  // A late answer about what was before a jump or a reset.
  if (ros_bridge::to_stamp(message->answers) < anew_from_) return;
  if (!scans_.empty() &&
      is_jump(ros_bridge::to_stamp(scans_.back()->header.stamp), ros_bridge::to_stamp(message->answers)))
    return;
  state_ = ros_bridge::to_state(*message);
  state_message_ = message;
  state_gate_->answered(ros_bridge::to_stamp(message->answers));
  propagator_.set_state(*state_, *imu_);
  if (imu_->empty()) publish_odometry(*state_);
  while (answer_front()) {
  }
}

void ImuPreintegration::on_scan(const ScanInfoConstPtr& message) {
  const Stamp stamp = ros_bridge::to_stamp(message->header.stamp);
  const bool is_jumping = previous_scan_ && (stamp < *previous_scan_ || is_jump(*previous_scan_, stamp));
  if (is_jumping || message->begins_anew) {
    // The recording was started again, a clock was set, or a reset: nothing of before belongs to it.
    anew_from_ = stamp;
    scans_.clear();
    previous_scan_.reset();
    sent_scan_.reset();
    state_.reset();
    state_message_.reset();
    state_gate_->reset();
    propagator_.reset();
  }
  if (scans_.empty()) front_since_ = SteadyClock::now();
  scans_.push_back(message);
  while (answer_front()) {
  }
}

bool ImuPreintegration::answer_front() {
  if (scans_.empty()) return false;
  const Stamp stamp = ros_bridge::to_stamp(scans_.front()->header.stamp);
  const double waited_s = seconds_since(front_since_);
  if (previous_scan_ && !state_gate_->is_open(*previous_scan_, waited_s)) return false;
  // Readings that deskewing had will come here too, unless this node started after them.
  const Stamp needed = std::min(add_seconds(stamp, state_ ? state_->lidar_time_offset_s : 0.0),
                                ros_bridge::to_stamp(scans_.front()->newest_imu));
  const bool has_readings = needed == 0 || (!imu_->empty() && imu_->newest() >= needed);
  if (!has_readings && waited_s < config().nodes.answer_timeout_s) return false;
  std::optional<Stamp> unanswered;
  if (sent_scan_ && !state_gate_->has_answered(*sent_scan_)) unanswered = sent_scan_;
  const auto preintegration = imu::preintegrate_scan_interval(*imu_, state_, unanswered, stamp, config());
  PreintegratedImuPtr message = boost::make_shared<PreintegratedImu>();
  if (preintegration) message = ros_bridge::to_message(*preintegration, config().frames.imu);
  message->header.stamp = scans_.front()->header.stamp;
  message->header.frame_id = config().frames.imu;
  // Not of long ago, which says nothing about where the robot is now.
  message->has_state = state_ && state_->stamp < stamp && !is_jump(state_->stamp, stamp);
  if (message->has_state) {
    odometry::EstimateResult carried;
    carried.state = imu::carried_on(*imu_, *state_, stamp, config());
    message->state = *ros_bridge::to_state_message(carried, stamp, config().frames.odom, config().frames.imu);
  }
  preintegration_publisher_.publish(message);
  previous_scan_ = stamp;
  // Mapping that is late estimates this scan before the next; mapping that was away has its last estimate.
  sent_scan_.reset();
  if (preintegration_publisher_.getNumSubscribers() > 0) sent_scan_ = stamp;
  scans_.pop_front();
  front_since_ = SteadyClock::now();
  return true;
}

void ImuPreintegration::check_waiting() {
  while (answer_front()) {
  }
  if (state_gate_->take_timeout())
    reporter()->report(Severity::kWarning, "mapping_silent",
                       "mapping_optimization does not answer: the odometry is the IMU's alone");
}

void ImuPreintegration::publish_odometry(const imu::NavState& state) {
  const auto T_base_imu = frames_->T_base_imu();
  if (!T_base_imu) return;
  const nav_msgs::Odometry odometry =
      ros_bridge::to_odometry(state, *T_base_imu, state_message_->covariance,
                              state_message_->velocity_covariance, config().sensor, config().frames);
  odometry_publisher_.publish(odometry);
  if (config().frames.publish_tf) frames_->send_transform(odometry);
}

void ImuPreintegration::fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) {
  status->add("IMU readings held", imu_->samples().size());
  status->add("waiting scans", scans_.size());
  status->add("waits for mapping that timed out", state_gate_->timeouts());
}

}  // namespace fdi_lio::nodes
