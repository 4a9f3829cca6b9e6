#include "fdi_lio/imu/imu_buffer.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/imu/noise_meter.hpp"

namespace fdi_lio::imu {

namespace {

constexpr double kStandardGravity = 9.80665;
constexpr double kSurelyInG = 3.0;  ///< smaller |acceleration| than this is no m/s^2

auto first_after(const std::deque<ImuSample>& samples, Stamp stamp) {
  return std::upper_bound(samples.begin(), samples.end(), stamp,
                          [](Stamp value, const ImuSample& sample) { return value < sample.stamp; });
}

}  // namespace

ImuBuffer::ImuBuffer(const SensorConfig& sensor, Reporter* reporter) : sensor_(sensor), reporter_(reporter) {}

double ImuBuffer::scale_of(const ImuSample& sample) const {
  if (scale_ != 0.0) return scale_;
  if (sensor_.acceleration_unit == "g") return kStandardGravity;
  if (sensor_.acceleration_unit == "m/s^2") return 1.0;
  // A vehicle neither falls freely nor pulls 3 g in its first reading, so the two units cannot be mixed up.
  return sample.acceleration.norm() < kSurelyInG ? kStandardGravity : 1.0;
}

void ImuBuffer::learn_scale(const ImuSample& sample) {
  if (scale_ != 0.0) return;
  scale_ = scale_of(sample);
  if (sensor_.acceleration_unit != "m/s^2" || sample.acceleration.norm() >= kSurelyInG) return;
  reporter_->report(Severity::kWarning, "imu_unit",
                    "|acceleration| is " + std::to_string(sample.acceleration.norm()) +
                        " where about 9.81 m/s^2 is expected: if the IMU reports g, set "
                        "sensor.acceleration_unit to g");
}

bool ImuBuffer::is_possible(const ImuSample& sample) const {
  return scale_of(sample) * sample.acceleration.norm() <= sensor_.max_acceleration_mps2 &&
         sample.angular_velocity.norm() <= sensor_.max_angular_rate_radps;
}

StampVerdict ImuBuffer::add(const ImuSample& sample) {
  if (!sample.acceleration.allFinite() || !sample.angular_velocity.allFinite()) {
    reporter_->report(Severity::kWarning, "imu_non_finite",
                      "an IMU reading with NaN or infinity was dropped");
    return StampVerdict::kDrop;
  }
  if (!is_possible(sample)) {
    reporter_->report(
        Severity::kWarning, "imu_limit",
        "an IMU reading that no sensor measures was dropped, " +
            std::to_string(scale_of(sample) * sample.acceleration.norm()) + " m/s^2 and " +
            std::to_string(sample.angular_velocity.norm()) +
            " rad/s: check cable, driver and units of the IMU; if it can measure so much, raise "
            "sensor.max_acceleration or sensor.max_angular_rate");
    return StampVerdict::kDrop;
  }
  const double step_s = samples_.empty() ? 0.0 : seconds_between(newest(), sample.stamp);
  const StampVerdict verdict = guard_.check(sample.stamp);
  if (verdict == StampVerdict::kDrop) {
    reporter_->report(Severity::kWarning, "imu_order",
                      "an IMU reading that is repeated, out of order or far from the others was dropped, " +
                          std::to_string(step_s) + " s after the newest");
    return verdict;
  }
  if (verdict == StampVerdict::kRestart) {
    reporter_->report(Severity::kWarning, "imu_restart",
                      "IMU stamps jumped by " + std::to_string(step_s) + " s: the IMU buffer was cleared");
    samples_.clear();
  }
  learn_scale(sample);
  samples_.push_back(sample);
  samples_.back().acceleration *= scale_;
  return verdict;
}

bool ImuBuffer::reaches(Stamp stamp, double lidar_time_offset_s) const {
  return !samples_.empty() && newest() >= add_seconds(stamp, lidar_time_offset_s);
}

std::vector<ImuSample> ImuBuffer::between(Stamp from, Stamp to, double lidar_time_offset_s) const {
  auto begin = first_after(samples_, add_seconds(from, lidar_time_offset_s));
  if (begin != samples_.begin()) --begin;
  auto end = std::lower_bound(begin, samples_.end(), add_seconds(to, lidar_time_offset_s),
                              [](const ImuSample& sample, Stamp value) { return sample.stamp < value; });
  if (end != samples_.end()) ++end;
  std::vector<ImuSample> readings(begin, end);
  for (ImuSample& reading : readings) reading.stamp = add_seconds(reading.stamp, -lidar_time_offset_s);
  return readings;
}

ImuStatistics ImuBuffer::statistics(Stamp to, double duration_s) const {
  ImuStatistics statistics;
  const auto begin = first_after(samples_, add_seconds(to, -duration_s));
  const auto end = first_after(samples_, to);
  if (begin >= end) return statistics;
  Eigen::Vector3d square_acceleration = Eigen::Vector3d::Zero();
  Eigen::Vector3d square_rate = Eigen::Vector3d::Zero();
  NoiseMeter noise;
  for (auto it = begin; it != end; ++it) {
    noise.add(*it);
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
  if (const auto density = noise.density()) {
    statistics.acceleration_noise = density->acceleration;
    statistics.angular_velocity_noise = density->angular_velocity;
  }
  return statistics;
}

void ImuBuffer::drop_before(Stamp stamp) {
  const auto keep = first_after(samples_, stamp);
  if (keep == samples_.begin()) return;
  samples_.erase(samples_.begin(), std::prev(keep));
}

void ImuBuffer::reset() {
  samples_.clear();
  guard_.reset();
  scale_ = 0.0;
}

}  // namespace fdi_lio::imu
