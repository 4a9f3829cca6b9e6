#pragma once

#include <deque>
#include <optional>
#include <string>

#include "node_base.hpp"
#include "sensor_frames.hpp"
#include <sensor_msgs/Imu.h>
#include <std_msgs/Empty.h>
#include <topic_tools/shape_shifter.h>

#include "fdi_lio/common/answer_gate.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/imu_buffer.hpp"
#include "fdi_lio/ros/scan_reader.hpp"
#include "fdi_lio/scan/data_check.hpp"
#include "fdi_lio/scan/scan_processor.hpp"
#include <fdi_lio/EstimatorState.h>

namespace fdi_lio::nodes {

/// scan_deskew: clouds or packets in, deskewed and filtered scans out. The first seconds are compared with
/// the parameters (scan::DataCheck); after an error nothing more is taken. A scan waits until the IMU has
/// reached its last point and mapping has answered the scan before, each no longer than AnswerGate says.
/// After a jump of the stamps or a reset the next scan tells the other nodes to begin anew as well. Scans
/// that wait are kept up to `nodes.scan_queue`; what is dropped beyond that is counted.
class ScanDeskew : public NodeBase {
 protected:
  void start() override;
  void check_waiting() override;
  void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) override;

 private:
  void on_lidar(const topic_tools::ShapeShifter::ConstPtr& message);
  void on_imu(const sensor_msgs::ImuConstPtr& message);
  void on_state(const EstimatorStateConstPtr& message);
  void on_reset(const std_msgs::EmptyConstPtr& message);
  void add_scan(Scan scan);
  void begin_anew();
  void check(const Scan& scan);
  void report_silence();
  bool prepare();
  bool process_front();
  void publish(const Scan& raw, const DeskewedScan& scan);

  std::optional<imu::ImuBuffer> imu_;
  std::optional<ros_bridge::ScanReader> reader_;
  std::optional<scan::DataCheck> check_;  ///< until it is over
  std::optional<Stamp> check_began_;
  bool is_refused_ = false;
  bool has_lidar_ = false;
  std::optional<scan::ScanProcessor> processor_;
  std::optional<AnswerGate> state_gate_, imu_gate_;
  std::optional<SensorFrames> frames_;
  StampGuard guard_;
  std::optional<imu::NavState> state_;
  std::optional<Stamp> previous_scan_;
  bool begins_anew_ = false;  ///< the next scan will say so
  Stamp anew_from_ = 0;       ///< the last scan that said so
  std::deque<Scan> scans_;
  SteadyClock::time_point started_;
  SteadyClock::time_point front_since_;
  std::string lidar_frame_;
  std::uint32_t lost_scans_ = 0;
  ros::Subscriber lidar_subscriber_, imu_subscriber_, state_subscriber_, reset_subscriber_;
  ros::Publisher info_publisher_, scan_publisher_, points_publisher_, removed_publisher_;
};

}  // namespace fdi_lio::nodes
