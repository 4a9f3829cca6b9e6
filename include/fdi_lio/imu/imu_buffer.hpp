#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/imu_types.hpp"

namespace fdi_lio::imu {

/// Readings in time order. Non-finite, repeated and late readings are counted and dropped; readings in g are
/// scaled.
class ImuBuffer {
 public:
  ImuBuffer(const SensorConfig& sensor, Reporter* reporter);

  /// Takes one reading; false when it was dropped. A stamp more than 10 s behind the newest one clears the
  /// buffer (a bag that was started again).
  bool add(const ImuSample& sample);

  bool empty() const { return samples_.empty(); }
  /// Stamp of the newest reading; the buffer must not be empty.
  Stamp newest() const { return samples_.back().stamp; }
  const std::deque<ImuSample>& samples() const { return samples_; }

  /// Readings that bound and fill [from, to]: the last at or before `from`, those between, the first at or
  /// after `to`.
  std::vector<ImuSample> between(Stamp from, Stamp to) const;

  /// Statistics of the readings in (to - duration, to].
  ImuStatistics statistics(Stamp to, double duration_s) const;

  /// Forgets readings that are older than the last one at or before `stamp`.
  void drop_before(Stamp stamp);

  void reset();

 private:
  double detect_scale(const ImuSample& sample);

  SensorConfig sensor_;
  Reporter* reporter_;
  std::deque<ImuSample> samples_;
  double scale_ = 0.0;  ///< acceleration to m/s^2; 0 until known
};

}  // namespace fdi_lio::imu
