#include "fdi_lio/imu/noise_meter.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::imu {

namespace {

constexpr double kBlock = 0.05;     ///< [s]
constexpr double kEvenSteps = 1.5;  ///< the longest over the shortest of a difference
constexpr int kLeastDifferences = 5;

}  // namespace

void NoiseMeter::add(const ImuSample& sample) {
  each_.add(sample);
  const double since_s = in_block_ > 0 ? seconds_between(sum_.stamp, sample.stamp) : 0.0;
  if (in_block_ > 0 && since_s >= kBlock) {
    ImuSample mean;
    mean.stamp = add_seconds(sum_.stamp, since_first_s_ / in_block_);
    mean.acceleration = sum_.acceleration / in_block_;
    mean.angular_velocity = sum_.angular_velocity / in_block_;
    means_.add(mean);
    in_block_ = 0;
  }
  if (in_block_ == 0) {
    sum_ = sample;
    since_first_s_ = 0.0;
  } else {
    sum_.acceleration += sample.acceleration;
    sum_.angular_velocity += sample.angular_velocity;
    since_first_s_ += since_s;
  }
  ++in_block_;
}

std::optional<NoiseMeter::Density> NoiseMeter::density() const {
  const auto each = each_.density();
  const auto means = means_.density();
  if (!each || !means) return std::nullopt;
  return Density{std::min(each->acceleration, means->acceleration),
                 std::min(each->angular_velocity, means->angular_velocity)};
}

void NoiseMeter::Differences::add(const ImuSample& sample) {
  std::move(last_.begin() + 1, last_.end(), last_.begin());
  last_.back() = sample;
  if (++added_ < static_cast<int>(last_.size())) return;
  std::array<double, 3> steps;
  for (std::size_t k = 0; k < steps.size(); ++k)
    steps[k] = seconds_between(last_[k].stamp, last_[k + 1].stamp);
  const auto [shortest, longest] = std::minmax_element(steps.begin(), steps.end());
  if (*longest > kEvenSteps * *shortest) return;
  acceleration_ += third(&ImuSample::acceleration).squaredNorm();
  angular_velocity_ += third(&ImuSample::angular_velocity).squaredNorm();
  step_s_ += seconds_between(last_.front().stamp, last_.back().stamp) / static_cast<double>(steps.size());
  ++count_;
}

Eigen::Vector3d NoiseMeter::Differences::third(Eigen::Vector3d ImuSample::*value) const {
  return last_[3].*value - last_[0].*value - 3.0 * (last_[2].*value - last_[1].*value);
}

std::optional<NoiseMeter::Density> NoiseMeter::Differences::density() const {
  if (count_ < kLeastDifferences) return std::nullopt;
  const auto of = [this](double squares) {
    return std::sqrt(step_s_ / count_ * squares / (3.0 * 20.0 * count_));
  };
  return Density{of(acceleration_), of(angular_velocity_)};
}

}  // namespace fdi_lio::imu
