#pragma once

#include <deque>
#include <optional>

#include "node_base.hpp"

#include "fdi_lio/common/answer_gate.hpp"
#include "fdi_lio/common/feedback.hpp"
#include "fdi_lio/degeneracy/degeneracy_estimator.hpp"
#include <fdi_lio/DeskewedCloud.h>
#include <fdi_lio/Features.h>
#include <fdi_lio/OptimisationStatus.h>

namespace fdi_lio::nodes {

/// degeneracy_estimation: the Degeneracy of each scan from the scan, its features, and what mapping found
/// about the scan before. When mapping does not answer in time its newest status is used, for a second; one
/// that is late or repeated changes nothing.
class DegeneracyEstimation : public NodeBase {
 protected:
  void start() override;
  void check_waiting() override;
  void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) override;

 private:
  static constexpr double kOldestStatusS = 1.0;

  void on_scan(const DeskewedCloudConstPtr& message);
  void on_features(const FeaturesConstPtr& message);
  void on_status(const OptimisationStatusConstPtr& message);
  bool process_front();

  std::optional<degeneracy::DegeneracyEstimator> estimator_;
  std::optional<AnswerGate> status_gate_;
  Feedback<degeneracy::OptimisationStatus> status_{kOldestStatusS};
  std::optional<Stamp> previous_scan_;
  Stamp anew_from_ = 0;  ///< what is said of earlier scans comes too late
  std::deque<DeskewedCloudConstPtr> scans_;
  std::deque<FeaturesConstPtr> features_;
  SteadyClock::time_point front_since_;
  ros::Subscriber scan_subscriber_, features_subscriber_, status_subscriber_;
  ros::Publisher degeneracy_publisher_, markers_publisher_;
};

}  // namespace fdi_lio::nodes
