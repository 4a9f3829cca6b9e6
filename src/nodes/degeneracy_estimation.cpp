#include "degeneracy_estimation.hpp"

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/ros/degeneracy_markers.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include <fdi_lio/Degeneracy.h>

namespace fdi_lio::nodes {

namespace {
constexpr std::size_t kQueue = 50;
}

void DegeneracyEstimation::start() {
  estimator_.emplace(config(), reporter());
  status_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  degeneracy_publisher_ = handle.advertise<Degeneracy>("degeneracy", 50);
  markers_publisher_ = handle.advertise<visualization_msgs::MarkerArray>("degeneracy/markers", 2);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  scan_subscriber_ = handle.subscribe("scan/deskewed", kQueue, &DegeneracyEstimation::on_scan, this, hints);
  features_subscriber_ =
      handle.subscribe("features/all", kQueue, &DegeneracyEstimation::on_features, this, hints);
  status_subscriber_ =
      handle.subscribe("mapping/status", kQueue, &DegeneracyEstimation::on_status, this, hints);
}

void DegeneracyEstimation::on_scan(const DeskewedCloudConstPtr& message) {
  if (!scans_.empty() && message->header.stamp < scans_.back()->header.stamp) scans_.clear();
  scans_.push_back(message);
  if (scans_.size() > kQueue) scans_.pop_front();
  while (process_front()) {
  }
}

void DegeneracyEstimation::on_features(const FeaturesConstPtr& message) {
  const Stamp stamp = ros_bridge::to_stamp(message->header.stamp);
  const bool is_jumping = previous_scan_ && (stamp < *previous_scan_ || is_jump(*previous_scan_, stamp));
  if (is_jumping || message->begins_anew) {
    anew_from_ = stamp;
    features_.clear();
    previous_scan_.reset();
    status_.reset();
    status_gate_->reset();
    estimator_->reset();
  }
  if (features_.empty()) front_since_ = SteadyClock::now();
  features_.push_back(message);
  if (features_.size() > kQueue) features_.pop_front();
  while (process_front()) {
  }
}

void DegeneracyEstimation::on_status(const OptimisationStatusConstPtr& message) {
  if (ros_bridge::to_stamp(message->header.stamp) < anew_from_) return;
  const degeneracy::OptimisationStatus status = ros_bridge::to_status(*message);
  status_.add(status);
  status_gate_->answered(status.stamp);
  while (process_front()) {
  }
}

bool DegeneracyEstimation::process_front() {
  if (features_.empty()) return false;
  const ros::Time stamp = features_.front()->header.stamp;
  while (!scans_.empty() && scans_.front()->header.stamp < stamp) scans_.pop_front();
  const double waited_s = seconds_since(front_since_);
  const bool has_scan = !scans_.empty() && scans_.front()->header.stamp == stamp;
  // A scan that this node never got (it was started in between) cannot be judged.
  if (!has_scan && scans_.empty() && waited_s < config().nodes.answer_timeout_s) return false;
  if (has_scan && previous_scan_ && !status_gate_->is_open(*previous_scan_, waited_s)) return false;
  features_.pop_front();
  front_since_ = SteadyClock::now();
  if (!has_scan) return true;
  previous_scan_ = ros_bridge::to_stamp(stamp);
  try {
    const degeneracy::Degeneracy degeneracy =
        estimator_->estimate(ros_bridge::to_scan(*scans_.front()), status_.before(*previous_scan_));
    degeneracy_publisher_.publish(ros_bridge::to_message(degeneracy, config().frames.imu));
    if (markers_publisher_.getNumSubscribers() > 0)
      markers_publisher_.publish(ros_bridge::degeneracy_markers(degeneracy, config().frames.imu));
  } catch (const Error& error) {
    reporter()->report(Severity::kError, "scan_message", error.what());
  }
  scans_.pop_front();
  return true;
}

void DegeneracyEstimation::check_waiting() {
  while (process_front()) {
  }
  if (status_gate_->take_timeout())
    reporter()->report(Severity::kWarning, "mapping_silent",
                       "mapping_optimization does not answer: the directions of the newest scan that it "
                       "answered are kept for a second");
}

void DegeneracyEstimation::fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) {
  status->add("waiting scans", features_.size());
  status->add("waits for mapping that timed out", status_gate_->timeouts());
}

}  // namespace fdi_lio::nodes
