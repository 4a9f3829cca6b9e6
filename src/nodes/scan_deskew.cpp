#include "scan_deskew.hpp"

#include <utility>

#include "fdi_lio/ros/conversions.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include <fdi_lio/DeskewedCloud.h>
#include <fdi_lio/ScanInfo.h>

namespace fdi_lio::nodes {

namespace {
constexpr double kKeptReadingsS = 30.0;
/// How long the first scan waits until the other nodes have connected: what is sent before is lost to them.
constexpr double kConnectS = 2.0;
}  // namespace

void ScanDeskew::start() {
  started_ = SteadyClock::now();
  imu_.emplace(config().sensor, reporter());
  reader_.emplace(config().sensor, reporter());
  state_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  frames_.emplace(config(), handle);
  info_publisher_ = handle.advertise<ScanInfo>("scan/info", 50);
  scan_publisher_ = handle.advertise<DeskewedCloud>("scan/deskewed", 50);
  points_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("scan/points", 2);
  removed_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("scan/removed", 2);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  cloud_subscriber_ =
      handle.subscribe(config().sensor.points_topic, static_cast<std::uint32_t>(config().nodes.scan_queue),
                       &ScanDeskew::on_cloud, this, hints);
  if (!config().sensor.imu_topic.empty())
    imu_subscriber_ = handle.subscribe(config().sensor.imu_topic, 2000, &ScanDeskew::on_imu, this, hints);
  state_subscriber_ = handle.subscribe("mapping/state", 50, &ScanDeskew::on_state, this, hints);
}

void ScanDeskew::on_imu(const sensor_msgs::ImuConstPtr& message) {
  frames_->learn_imu_frame(message->header.frame_id);
  if (imu_->add(ros_bridge::to_imu_sample(*message)) == StampVerdict::kDrop) return;
  const Stamp kept = scans_.empty() ? imu_->newest() : std::min(imu_->newest(), scans_.front().stamp);
  imu_->drop_before(add_seconds(kept, -kKeptReadingsS));
  while (process_front()) {
  }
}

void ScanDeskew::on_state(const EstimatorStateConstPtr& message) {
  state_ = ros_bridge::to_state(*message);
  state_gate_->answered(ros_bridge::to_stamp(message->answers));
  while (process_front()) {
  }
}

void ScanDeskew::on_cloud(const sensor_msgs::PointCloud2ConstPtr& message) {
  lidar_frame_ = message->header.frame_id;
  std::optional<Scan> scan = reader_->read(ros_bridge::to_raw_cloud(*message));
  if (!scan) return;
  switch (guard_.check(scan->stamp)) {
    case StampVerdict::kDrop:
      reporter()->report(Severity::kWarning, "scan_order",
                         "a scan was dropped: its stamp does not follow the one before");
      return;
    case StampVerdict::kRestart:
      reporter()->report(Severity::kWarning, "scan_jump",
                         "the stamps of the scans jumped by more than 10 s: starting anew");
      scans_.clear();
      previous_scan_.reset();
      state_.reset();
      state_gate_->reset();
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
  scans_.push_back(std::move(*scan));
  while (process_front()) {
  }
}

bool ScanDeskew::prepare() {
  if (processor_) return true;
  const bool is_heard = info_publisher_.getNumSubscribers() > 0 && scan_publisher_.getNumSubscribers() > 2;
  if (!is_heard && seconds_since(started_) < kConnectS) return false;
  const auto T_imu_lidar = frames_->T_imu_lidar(lidar_frame_);
  if (!T_imu_lidar) return false;
  Config known = config();
  known.sensor.t_imu_lidar = T_imu_lidar->translation();
  known.sensor.q_imu_lidar = Eigen::Quaterniond(T_imu_lidar->rotation());
  processor_.emplace(known, reporter());
  return true;
}

bool ScanDeskew::process_front() {
  if (scans_.empty() || !prepare()) return false;
  const Stamp stamp = scans_.front().stamp;
  const double waited_s = seconds_since(front_since_);
  const bool has_readings = !imu_->empty() && imu_->newest() >= stamp;
  // The last scan of a recording has no next one, and the IMU may have ended before it.
  if (!has_readings && scans_.size() < 2 && waited_s < config().nodes.answer_timeout_s) return false;
  if (previous_scan_ && !state_gate_->is_open(*previous_scan_, waited_s)) return false;
  const Scan raw = std::move(scans_.front());
  scans_.pop_front();
  front_since_ = SteadyClock::now();
  previous_scan_ = stamp;
  publish(raw, processor_->process(raw, state_, *imu_));
  return true;
}

void ScanDeskew::publish(const Scan& raw, const DeskewedScan& scan) {
  ScanInfo info;
  info.header.stamp = ros_bridge::to_ros_time(scan.stamp);
  info.header.frame_id = lidar_frame_;
  info.duration = scan.duration_s;
  if (!imu_->empty()) info.newest_imu = ros_bridge::to_ros_time(imu_->newest());
  info.points = static_cast<std::uint32_t>(scan.points.size());
  info.non_finite = static_cast<std::uint32_t>(raw.dropped.non_finite);
  info.zero = static_cast<std::uint32_t>(raw.dropped.zero);
  info.out_of_range = static_cast<std::uint32_t>(raw.dropped.out_of_range);
  info.duplicate = static_cast<std::uint32_t>(raw.dropped.duplicate);
  info.moving = static_cast<std::uint32_t>(scan.removed.size());
  info.lost_scans = lost_scans_;
  info_publisher_.publish(info);
  const DeskewedCloudPtr message = ros_bridge::to_message(scan, lidar_frame_);
  scan_publisher_.publish(message);
  if (points_publisher_.getNumSubscribers() > 0) points_publisher_.publish(message->points);
  if (removed_publisher_.getNumSubscribers() > 0) removed_publisher_.publish(message->removed);
  frames_->publish_sensors(lidar_frame_);
}

void ScanDeskew::check_waiting() {
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
}

}  // namespace fdi_lio::nodes
