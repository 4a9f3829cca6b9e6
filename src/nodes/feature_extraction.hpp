#pragma once

#include <deque>
#include <optional>

#include "node_base.hpp"

#include "fdi_lio/common/answer_gate.hpp"
#include "fdi_lio/common/feedback.hpp"
#include "fdi_lio/features/feature_extractor.hpp"
#include <fdi_lio/Degeneracy.h>
#include <fdi_lio/DeskewedCloud.h>

namespace fdi_lio::nodes {

/// feature_extraction: features of a deskewed scan, chosen with the degeneracy of the scan before. When that
/// does not come in time the newest one is used if it is at most a second old, and else the neutral value;
/// one that is late or repeated changes nothing.
class FeatureExtraction : public NodeBase {
 protected:
  void start() override;
  void check_waiting() override;
  void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) override;

 private:
  static constexpr double kOldestFeedbackS = 1.0;

  void on_scan(const DeskewedCloudConstPtr& message);
  void on_degeneracy(const DegeneracyConstPtr& message);
  bool process_front();

  std::optional<features::FeatureExtractor> extractor_;
  std::optional<AnswerGate> degeneracy_gate_;
  Feedback<degeneracy::Degeneracy> degeneracy_{kOldestFeedbackS};
  std::optional<Stamp> previous_scan_;
  Stamp anew_from_ = 0;  ///< what is said of earlier scans comes too late
  std::deque<DeskewedCloudConstPtr> scans_;
  SteadyClock::time_point front_since_;
  ros::Subscriber scan_subscriber_, degeneracy_subscriber_;
  ros::Publisher features_publisher_, planes_publisher_, edges_publisher_, intensity_publisher_;
};

}  // namespace fdi_lio::nodes
