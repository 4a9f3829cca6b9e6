#pragma once

#include <deque>
#include <optional>

#include "node_base.hpp"
#include "sensor_frames.hpp"
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Imu.h>

#include "fdi_lio/common/answer_gate.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/imu/propagation.hpp"
#include <fdi_lio/EstimatorState.h>
#include <fdi_lio/ScanInfo.h>

namespace fdi_lio::nodes {

/// imu_preintegration: IMU-rate odometry and tf odom -> base_link from the newest estimate, and the
/// preintegrated IMU of each scan interval. Without an IMU the odometry comes at the rate of the lidar.
class ImuPreintegration : public NodeBase {
 protected:
  void start() override;
  void check_waiting() override;
  void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) override;

 private:
  void on_imu(const sensor_msgs::ImuConstPtr& message);
  void on_state(const EstimatorStateConstPtr& message);
  void on_scan(const ScanInfoConstPtr& message);
  bool answer_front();
  void publish_odometry(const imu::NavState& state);

  std::optional<imu::ImuBuffer> imu_;
  std::optional<AnswerGate> state_gate_;
  imu::ImuPropagator propagator_;
  std::optional<imu::NavState> state_;
  EstimatorStateConstPtr state_message_;
  std::optional<Stamp> previous_scan_;
  std::optional<Stamp> sent_scan_;  ///< the same, if mapping was there to hear of it
  Stamp anew_from_ = 0;             ///< what is said of earlier scans comes too late
  std::deque<ScanInfoConstPtr> scans_;
  SteadyClock::time_point front_since_;
  std::optional<SensorFrames> frames_;
  ros::Subscriber imu_subscriber_, state_subscriber_, scan_subscriber_;
  ros::Publisher odometry_publisher_, preintegration_publisher_;
};

}  // namespace fdi_lio::nodes
