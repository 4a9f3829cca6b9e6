#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <diagnostic_updater/diagnostic_updater.h>
#include <nodelet/nodelet.h>
#include <ros/ros.h>
#include <tbb/global_control.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"

namespace fdi_lio::nodes {

using SteadyClock = std::chrono::steady_clock;

inline double seconds_since(SteadyClock::time_point begin) {
  return std::chrono::duration<double>(SteadyClock::now() - begin).count();
}

/// What the five nodes share: parameters from the file `~config` and the overrides `~set` (key=value,
/// separated by spaces), a reporter whose notices go to the log and to /diagnostics, and a timer for time
/// limits. Callbacks of one node never run at the same time.
class NodeBase : public nodelet::Nodelet {
 protected:
  /// Reads the parameters, then calls `start`. A wrong parameter is logged and ends the load.
  void onInit() final;

  /// Subscribes and advertises.
  virtual void start() = 0;

  /// Called 50 times a second of real time: what waits may have waited long enough.
  virtual void check_waiting() {}

  /// Adds figures of the node to its diagnostics.
  virtual void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* /*status*/) {}

  const Config& config() const { return config_; }
  Reporter* reporter() { return &reporter_; }

  /// Notices that became due go to the log.
  void log_notices();

 private:
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  Config config_;
  Reporter reporter_;
  std::unique_ptr<diagnostic_updater::Updater> updater_;
  std::unique_ptr<tbb::global_control> threads_;
  ros::SteadyTimer timer_;
};

}  // namespace fdi_lio::nodes
