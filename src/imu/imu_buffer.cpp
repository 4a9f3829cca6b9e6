#include "fdi_lio/imu/imu_buffer.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::imu {

namespace {

constexpr double kRestartSeconds = 10.0;  ///< a larger step back is a recording that began again
constexpr double kStandardGravity = 9.80665;

auto first_after(const std::deque<ImuSample>& samples, Stamp stamp) {
  return std::upper_bound(samples.begin(), samples.end(), stamp,
                          [](Stamp value, const ImuSample& sample) { return value < sample.stamp; });
}

}  // namespace

ImuBuffer::ImuBuffer(const SensorConfig& sensor, Reporter* reporter) : sensor_(sensor), reporter_(reporter) {}

double ImuBuffer::detect_scale(const ImuSample& sample) {
  if (sensor_.acceleration_unit == "g") return kStandardGravity;
  if (sensor_.acceleration_unit == "m/s^2") {
    if (sample.acceleration.norm() < 3.0) {
      reporter_->report(Severity::kWarning, "imu_unit",
                        "|acceleration| is " + std::to_string(sample.acceleration.norm()) +
                            " where about 9.81 m/s^2 is expected: if the IMU reports g, set "
                            "sensor.acceleration_unit to g");
    }
    return 1.0;
  }
  // A vehicle neither falls freely nor pulls 3 g in its first reading, so the two units cannot be mixed up.
  return sample.acceleration.norm() < 3.0 ? kStandardGravity : 1.0;
}

bool ImuBuffer::add(const ImuSample& sample) {
  if (!sample.acceleration.allFinite() || !sample.angular_velocity.allFinite()) {
    reporter_->report(Severity::kWarning, "imu_non_finite",
                      "an IMU reading with NaN or infinity was dropped");
    return false;
  }
  if (!samples_.empty() && sample.stamp <= newest()) {
    if (seconds_between(sample.stamp, newest()) <= kRestartSeconds) {
      reporter_->report(Severity::kWarning, "imu_order",
                        "an IMU reading that is repeated or out of order was dropped, " +
                            std::to_string(seconds_between(sample.stamp, newest())) + " s behind the newest");
      return false;
    }
    reporter_->report(Severity::kWarning, "imu_restart",
                      "IMU stamps jumped back: the IMU buffer was cleared");
    samples_.clear();
  }
  if (scale_ == 0.0) scale_ = detect_scale(sample);
  samples_.push_back(sample);
  samples_.back().acceleration *= scale_;
  return true;
}

std::vector<ImuSample> ImuBuffer::between(Stamp from, Stamp to) const {
  auto begin = first_after(samples_, from);
  if (begin != samples_.begin()) --begin;
  auto end = std::lower_bound(begin, samples_.end(), to,
                              [](const ImuSample& sample, Stamp value) { return sample.stamp < value; });
  if (end != samples_.end()) ++end;
  return {begin, end};
}

ImuStatistics ImuBuffer::statistics(Stamp to, double duration_s) const {
  ImuStatistics statistics;
  const auto begin = first_after(samples_, add_seconds(to, -duration_s));
  const auto end = first_after(samples_, to);
  if (begin >= end) return statistics;
  Eigen::Vector3d square_acceleration = Eigen::Vector3d::Zero();
  Eigen::Vector3d square_rate = Eigen::Vector3d::Zero();
  for (auto it = begin; it != end; ++it) {
    statistics.mean_acceleration += it->acceleration;
    statistics.mean_angular_velocity += it->angular_velocity;
    square_acceleration += it->acceleration.cwiseAbs2();
    square_rate += it->angular_velocity.cwiseAbs2();
  }
  statistics.count = static_cast<std::uint32_t>(end - begin);
  statistics.duration_s = seconds_between(begin->stamp, std::prev(end)->stamp);
  const double scale = 1.0 / statistics.count;
  statistics.mean_acceleration *= scale;
  statistics.mean_angular_velocity *= scale;
  const auto deviation = [scale](const Eigen::Vector3d& square, const Eigen::Vector3d& mean) {
    return std::sqrt(std::max(0.0, square.sum() * scale - mean.squaredNorm()));
  };
  statistics.acceleration_std = deviation(square_acceleration, statistics.mean_acceleration);
  statistics.angular_velocity_std = deviation(square_rate, statistics.mean_angular_velocity);
  return statistics;
}

void ImuBuffer::drop_before(Stamp stamp) {
  const auto keep = first_after(samples_, stamp);
  if (keep == samples_.begin()) return;
  samples_.erase(samples_.begin(), std::prev(keep));
}

void ImuBuffer::reset() {
  samples_.clear();
  scale_ = 0.0;
}

}  // namespace fdi_lio::imu
