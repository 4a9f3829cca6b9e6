#include "feature_extraction.hpp"

#include <sensor_msgs/PointCloud2.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include <fdi_lio/Features.h>

namespace fdi_lio::nodes {

namespace {
constexpr std::size_t kQueue = 50;
}  // namespace

void FeatureExtraction::start() {
  extractor_.emplace(config(), reporter());
  degeneracy_gate_.emplace(config().nodes.answer_timeout_s);
  ros::NodeHandle& handle = getNodeHandle();
  features_publisher_ = handle.advertise<Features>("features/all", 50);
  planes_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("features/planes", 2);
  edges_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("features/edges", 2);
  intensity_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("features/intensity", 2);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  scan_subscriber_ = handle.subscribe("scan/deskewed", kQueue, &FeatureExtraction::on_scan, this, hints);
  degeneracy_subscriber_ =
      handle.subscribe("degeneracy", kQueue, &FeatureExtraction::on_degeneracy, this, hints);
}

void FeatureExtraction::on_scan(const DeskewedCloudConstPtr& message) {
  const Stamp stamp = ros_bridge::to_stamp(message->header.stamp);
  const bool is_jumping = previous_scan_ && (stamp < *previous_scan_ || is_jump(*previous_scan_, stamp));
  if (is_jumping || message->begins_anew) {
    anew_from_ = stamp;
    scans_.clear();
    previous_scan_.reset();
    degeneracy_.reset();
    degeneracy_gate_->reset();
  }
  if (scans_.empty()) front_since_ = SteadyClock::now();
  scans_.push_back(message);
  if (scans_.size() > kQueue) {
    scans_.pop_front();
    reporter()->report(Severity::kError, "scan_lost", "a deskewed scan was dropped: too many wait");
  }
  while (process_front()) {
  }
}

void FeatureExtraction::on_degeneracy(const DegeneracyConstPtr& message) {
  if (ros_bridge::to_stamp(message->header.stamp) < anew_from_) return;
  const degeneracy::Degeneracy degeneracy = ros_bridge::to_degeneracy(*message);
  degeneracy_.add(degeneracy);
  degeneracy_gate_->answered(degeneracy.stamp);
  while (process_front()) {
  }
}

bool FeatureExtraction::process_front() {
  if (scans_.empty()) return false;
  if (previous_scan_ && !degeneracy_gate_->is_open(*previous_scan_, seconds_since(front_since_)))
    return false;
  const DeskewedCloudConstPtr message = scans_.front();
  scans_.pop_front();
  front_since_ = SteadyClock::now();
  const Stamp stamp = ros_bridge::to_stamp(message->header.stamp);
  previous_scan_ = stamp;
  const degeneracy::Degeneracy feedback = degeneracy_.before(stamp).value_or(degeneracy::Degeneracy());
  try {
    const FeaturesPtr features = ros_bridge::to_message(
        extractor_->extract(ros_bridge::to_scan(*message), feedback), message->header.frame_id);
    features->begins_anew = message->begins_anew;
    features_publisher_.publish(features);
    if (planes_publisher_.getNumSubscribers() > 0) planes_publisher_.publish(features->planes);
    if (edges_publisher_.getNumSubscribers() > 0) edges_publisher_.publish(features->edges);
    if (intensity_publisher_.getNumSubscribers() > 0) intensity_publisher_.publish(features->intensity_edges);
  } catch (const Error& error) {
    reporter()->report(Severity::kError, "scan_message", error.what());
  }
  return true;
}

void FeatureExtraction::check_waiting() {
  while (process_front()) {
  }
  if (degeneracy_gate_->take_timeout())
    reporter()->report(Severity::kWarning, "degeneracy_silent",
                       "degeneracy_estimation does not answer: features are chosen with the neutral value");
}

void FeatureExtraction::fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) {
  status->add("waiting scans", scans_.size());
  status->add("waits for degeneracy that timed out", degeneracy_gate_->timeouts());
}

}  // namespace fdi_lio::nodes
