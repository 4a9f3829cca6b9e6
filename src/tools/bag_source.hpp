#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rosbag/bag.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/mapping/external_odometry.hpp"
#include "fdi_lio/mapping/gnss_aligner.hpp"

namespace fdi_lio::tools {

/// What is done with each message; `position_s` is the receive time since the start of the recording.
struct BagCallbacks {
  std::function<void(const imu::ImuSample&)> on_imu;
  std::function<void(Scan)> on_scan;
  /// May be empty: then fixes are not read.
  std::function<void(const mapping::GnssFix&)> on_fix = nullptr;
  /// May be empty: then no other odometry is read.
  std::function<void(const mapping::ExternalPose&)> on_external = nullptr;
  /// Returns false to stop.
  std::function<bool(double position_s)> on_progress;
  /// Called with the stage's name and its duration in milliseconds.
  std::function<void(const std::string&, double)> on_timing;
};

/// A topic of a recording.
struct BagTopic {
  std::string name;
  std::string type;
  std::size_t messages = 0;
};

/// One or more bags, read as one recording in the order of receive time.
class BagSource {
 public:
  /// Opens the bags and looks for the topics of `sensor`. Where the lidar's is missing, the only topic of a
  /// fitting type takes its place, and `reporter` is told. Throws Error when a bag is missing, truncated,
  /// unindexed or has no lidar topic or a choice of them; the text lists those of the right type. Without an
  /// IMU topic the same goes to `reporter`: an IMU elsewhere on the robot would need another extrinsic.
  BagSource(const std::vector<std::string>& paths, const SensorConfig& sensor, Reporter* reporter);

  /// Reads [start_s, start_s + duration_s] of the recording; a duration of 0 or less means to the end. A
  /// thread decodes ahead; the callbacks are called in this one. What is wrong with messages is reported to
  /// `reporter`. Throws Error where the file is damaged.
  void read(double start_s, double duration_s, Reporter* reporter, const BagCallbacks& callbacks);

  /// Length of what `read` would read.
  double duration_s(double start_s, double duration_s) const;

  /// The lidar's topic: that of `sensor`, or the one that takes its place.
  const std::string& points_topic() const { return sensor_.points_topic; }

  /// Every topic, in alphabetical order.
  std::vector<BagTopic> topics() const;

 private:
  SensorConfig sensor_;
  std::vector<std::unique_ptr<rosbag::Bag>> bags_;
  double total_s_ = 0.0;
};

}  // namespace fdi_lio::tools
