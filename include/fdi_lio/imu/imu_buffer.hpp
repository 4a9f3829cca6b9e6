#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/stamp_guard.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// Readings in time order. Readings that are not finite, beyond what a sensor can measure, repeated, late or
/// far from the others in time are counted and dropped; readings in g are scaled.
class ImuBuffer {
 public:
  ImuBuffer(const SensorConfig& sensor, Reporter* reporter);

  /// Takes one reading, or drops it. A jump of the stamps that the next reading confirms (StampGuard) clears
  /// the buffer first: kRestart.
  StampVerdict add(const ImuSample& sample);

  /// Whether a sensor can have measured it: within sensor.max_acceleration and sensor.max_angular_rate.
  bool is_possible(const ImuSample& sample) const;

  bool empty() const { return samples_.empty(); }
  /// Stamp of the newest reading; the buffer must not be empty.
  Stamp newest() const { return samples_.back().stamp; }
  const std::deque<ImuSample>& samples() const { return samples_; }

  /// Whether there are readings up to `stamp`, in the clock of the scans (NavState::lidar_time_offset_s).
  bool reaches(Stamp stamp, double lidar_time_offset_s) const;

  /// Readings that bound and fill [from, to]: the last at or before `from`, those between, the first at or
  /// after `to`. `from`, `to` and the stamps of what is given are in the clock of the scans.
  std::vector<ImuSample> between(Stamp from, Stamp to, double lidar_time_offset_s) const;

  /// Statistics of the readings in (to - duration, to], in the clock of the IMU.
  ImuStatistics statistics(Stamp to, double duration_s) const;

  /// Forgets readings that are older than the last one at or before `stamp`.
  void drop_before(Stamp stamp);

  void reset();

 private:
  double scale_of(const ImuSample& sample) const;
  void learn_scale(const ImuSample& sample);

  SensorConfig sensor_;
  Reporter* reporter_;
  StampGuard guard_;
  std::deque<ImuSample> samples_;
  double scale_ = 0.0;  ///< acceleration to m/s^2; 0 until known
};

}  // namespace fdi_lio::imu
