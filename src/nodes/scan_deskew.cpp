#include "scan_deskew.hpp"

#include <cmath>
#include <utility>

#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include <fdi_lio/DeskewedCloud.h>
#include <fdi_lio/ScanInfo.h>

namespace fdi_lio::nodes {

namespace {
constexpr double kKeptReadingsS = 30.0;
/// How long the first scan waits until the other nodes have connected: what is sent before is lost to them.
constexpr double kConnectS = 2.0;
/// How long nothing may come from the lidar before a word is said.
constexpr double kSilenceS = 10.0;
}  // namespace

void ScanDeskew::start() {
  started_ = SteadyClock::now();
  imu_.emplace(config().sensor, reporter());
  reader_.emplace(config().sensor, reporter());
  if (config().check.enabled) check_.emplace(config());
  state_gate_.emplace(config().nodes.answer_timeout_s);
  imu_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  frames_.emplace(config(), handle);
  info_publisher_ = handle.advertise<ScanInfo>("scan/info", 50);
  scan_publisher_ = handle.advertise<DeskewedCloud>("scan/deskewed", 50);
  points_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("scan/points", 2);
  removed_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("scan/removed", 2);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  lidar_subscriber_ =
      handle.subscribe(config().sensor.points_topic, static_cast<std::uint32_t>(config().nodes.scan_queue),
                       &ScanDeskew::on_lidar, this, hints);
  // For who plays a recording: where to, and how long the last scan waits.
  getPrivateNodeHandle().setParam("points_topic", lidar_subscriber_.getTopic());
  getPrivateNodeHandle().setParam("answer_timeout", config().nodes.answer_timeout_s);
  if (!config().sensor.imu_topic.empty())
    imu_subscriber_ = handle.subscribe(config().sensor.imu_topic, 2000, &ScanDeskew::on_imu, this, hints);
  state_subscriber_ = handle.subscribe("mapping/state", 50, &ScanDeskew::on_state, this, hints);
  reset_subscriber_ = handle.subscribe("mapping/reset", 1, &ScanDeskew::on_reset, this, hints);
}

void ScanDeskew::on_imu(const sensor_msgs::ImuConstPtr& message) {
  frames_->learn_imu_frame(message->header.frame_id);
  const imu::ImuSample sample = ros_bridge::to_imu_sample(*message);
  if (check_) check_->add_imu(sample);
  const StampVerdict verdict = imu_->add(sample);
  if (verdict == StampVerdict::kDrop) return;
  if (verdict == StampVerdict::kRestart) imu_gate_->reset();
  imu_gate_->answered(imu_->newest());
  const Stamp kept = scans_.empty() ? imu_->newest() : std::min(imu_->newest(), scans_.front().stamp);
  imu_->drop_before(add_seconds(kept, -kKeptReadingsS));
  while (process_front()) {
  }
}

void ScanDeskew::on_state(const EstimatorStateConstPtr& message) {
  const Stamp answers = ros_bridge::to_stamp(message->answers);
  // A late answer about what was before a jump or a reset.
  if (begins_anew_ || answers < anew_from_) return;
  if (!scans_.empty() && is_jump(scans_.back().stamp, answers)) return;
  state_ = ros_bridge::to_state(*message);
  state_gate_->answered(answers);
  while (process_front()) {
  }
}

void ScanDeskew::on_lidar(const topic_tools::ShapeShifter::ConstPtr& message) {
  has_lidar_ = true;
  if (is_refused_) return;
  try {
    std::optional<Scan> scan = reader_->read(*message, ros::Time::now(), &lidar_frame_);
    if (scan) add_scan(std::move(*scan));
  } catch (const ros::serialization::StreamOverrunException&) {
    reporter()->report(
        Severity::kWarning, "message_damaged",
        "a message on " + config().sensor.points_topic + " was dropped: it is shorter than it says");
  }
}

void ScanDeskew::check(const Scan& scan) {
  if (!check_) return;
  check_->add_scan(scan);
  if (!check_began_) check_began_ = scan.stamp;
  if (std::abs(seconds_between(*check_began_, scan.stamp)) < config().check.duration_s || !processor_) return;
  is_refused_ = scan::report_findings(check_->findings(), reporter());
  check_.reset();
  if (!is_refused_) return;
  scans_.clear();
  reporter()->report(Severity::kError, "check",
                     "the data do not fit the parameters, nothing more of them is used: mend what the other "
                     "messages name and start this node again, or go on regardless with check.enabled=false");
}

void ScanDeskew::add_scan(Scan scan) {
  check(scan);
  if (is_refused_) return;
  switch (guard_.check(scan.stamp)) {
    case StampVerdict::kDrop:
      reporter()->report(Severity::kWarning, "scan_order",
                         "a scan was dropped: its stamp does not follow the one before");
      return;
    case StampVerdict::kRestart:
      reporter()->report(Severity::kWarning, "scan_jump",
                         "the stamps of the scans jumped by more than 10 s: starting anew");
      begin_anew();
      break;
    case StampVerdict::kAccept:
      break;
  }
  if (scans_.size() >= static_cast<std::size_t>(config().nodes.scan_queue)) {
    scans_.pop_front();
    ++lost_scans_;
    reporter()->report(Severity::kError, "scan_lost",
                       "scans come faster than this machine works: the oldest one that waits is dropped "
                       "(play the recording more slowly, or use offline_slam)");
  }
  if (scans_.empty()) front_since_ = SteadyClock::now();
  scans_.push_back(std::move(scan));
  while (process_front()) {
  }
}

void ScanDeskew::begin_anew() {
  lost_scans_ += static_cast<std::uint32_t>(scans_.size());
  scans_.clear();
  previous_scan_.reset();
  state_.reset();
  state_gate_->reset();
  processor_.reset();
  begins_anew_ = true;
}

void ScanDeskew::on_reset(const std_msgs::EmptyConstPtr& /*message*/) {
  reporter()->report(Severity::kInfo, "reset", "a reset was asked for: beginning anew with the next scan");
  begin_anew();
}

bool ScanDeskew::prepare() {
  if (processor_) return true;
  const bool is_heard = info_publisher_.getNumSubscribers() > 0 && scan_publisher_.getNumSubscribers() > 2;
  if (!is_heard && seconds_since(started_) < kConnectS) return false;
  const auto known = frames_->config_with_extrinsics(lidar_frame_);
  if (!known) return false;
  processor_.emplace(*known, reporter());
  if (check_) check_->set_extrinsic(known->sensor.T_imu_lidar());
  return true;
}

bool ScanDeskew::process_front() {
  if (scans_.empty() || !prepare()) return false;
  const Stamp stamp = scans_.front().stamp;
  const double waited_s = seconds_since(front_since_);
  if (previous_scan_ && !state_gate_->is_open(*previous_scan_, waited_s)) return false;
  // A next scan does not prove that no more readings come: on a busy machine clouds overtake them.
  const Stamp needed = add_seconds(stamp, state_ ? state_->lidar_time_offset_s : 0.0);
  if (imu_subscriber_ && !imu_gate_->is_open(needed, waited_s)) return false;
  const Scan raw = std::move(scans_.front());
  scans_.pop_front();
  front_since_ = SteadyClock::now();
  previous_scan_ = stamp;
  if (begins_anew_) anew_from_ = stamp;
  publish(raw, processor_->process(raw, state_, *imu_));
  return true;
}

void ScanDeskew::publish(const Scan& raw, const DeskewedScan& scan) {
  ScanInfo info;
  info.begins_anew = begins_anew_;
  info.header.stamp = ros_bridge::to_ros_time(scan.stamp);
  info.header.frame_id = lidar_frame_;
  info.duration = scan.duration_s;
  if (!imu_->empty()) info.newest_imu = ros_bridge::to_ros_time(imu_->newest());
  info.points = static_cast<std::uint32_t>(scan.points.size());
  info.non_finite = static_cast<std::uint32_t>(raw.dropped.non_finite);
  info.zero = static_cast<std::uint32_t>(raw.dropped.zero);
  info.out_of_range = static_cast<std::uint32_t>(raw.dropped.out_of_range);
  info.duplicate = static_cast<std::uint32_t>(raw.dropped.duplicate);
  info.moving = static_cast<std::uint32_t>(scan.moving_count());
  info.isolated = static_cast<std::uint32_t>(scan.removed.size() - scan.moving_count());
  info.lost_scans = lost_scans_;
  info_publisher_.publish(info);
  const DeskewedCloudPtr message = ros_bridge::to_message(scan, lidar_frame_);
  message->begins_anew = begins_anew_;
  begins_anew_ = false;
  scan_publisher_.publish(message);
  if (points_publisher_.getNumSubscribers() > 0) points_publisher_.publish(message->points);
  if (removed_publisher_.getNumSubscribers() > 0) removed_publisher_.publish(message->removed);
  frames_->publish_sensors(lidar_frame_);
}

void ScanDeskew::report_silence() {
  if (has_lidar_ || seconds_since(started_) < kSilenceS) return;
  has_lidar_ = true;  // said once
  std::string fitting;
  ros::master::V_TopicInfo topics;
  ros::master::getTopics(topics);
  for (const ros::master::TopicInfo& topic : topics) {
    const bool is_own = topic.name.rfind(getNodeHandle().getNamespace() + "/", 0) == 0;
    if (!is_own && ros_bridge::ScanReader::types().count(topic.datatype) > 0) fitting += " " + topic.name;
  }
  reporter()->report(
      Severity::kWarning, "no_lidar",
      "nothing has come on " + lidar_subscriber_.getTopic() +
          " yet (sensor.points_topic); topics of a fitting type:" + (fitting.empty() ? " none" : fitting));
}

void ScanDeskew::check_waiting() {
  report_silence();
  while (process_front()) {
  }
  if (state_gate_->take_timeout())
    reporter()->report(Severity::kWarning, "mapping_silent",
                       "mapping_optimization does not answer: scans are deskewed from its newest estimate");
}

void ScanDeskew::fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) {
  status->add("waiting scans", scans_.size());
  status->add("lost scans", lost_scans_);
  status->add("waits for mapping that timed out", state_gate_->timeouts());
  status->add("waits for the IMU that timed out", imu_gate_->timeouts());
}

}  // namespace fdi_lio::nodes
