#include <algorithm>
#include <array>
#include <cmath>

#include "fdi_lio/simulation/random.hpp"
#include "fdi_lio/simulation/random_streams.hpp"
#include "fdi_lio/simulation/route.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kStep = 0.5;            // metres between points of the speed plan
constexpr double kKnotPeriod = 0.04;     // seconds
constexpr double kLookaheadS = 1.0;      // seconds beyond the end of the recording
constexpr double kSpeedSmoothing = 0.5;  // seconds; standard deviation, keeps the jerk at a driver's

/// Speed allowed at each step of arc length from `start`: bends, then what braking and accelerating can do.
std::vector<double> speed_limits(const Route& route, const MotionSettings& motion, double start,
                                 double reach) {
  const std::size_t count = static_cast<std::size_t>(reach / kStep) + 2;
  // A driver is slow all through a bend; this also makes up for the smoothing of the speed further down.
  const double margin = kSpeedSmoothing * std::min(motion.speed_mps, 8.0);
  std::vector<double> limits(count, motion.speed_mps);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = start + kStep * static_cast<double>(i);
    double curvature = 1e-6;
    for (double ahead = -margin; ahead <= margin; ahead += kStep) {
      curvature = std::max(curvature, std::abs(route.at(s + ahead).curvature));
    }
    limits[i] = std::min(limits[i], std::sqrt(motion.max_lateral_acceleration / curvature));
    if (!route.closed() && s > route.length() - 1.0) limits[i] = 0.05;
  }
  const double gain = 2.0 * motion.max_acceleration * kStep;
  for (std::size_t i = count - 1; i-- > 0;)
    limits[i] = std::min(limits[i], std::sqrt(limits[i + 1] * limits[i + 1] + gain));
  return limits;
}

std::vector<double> gaussian_smoothed(const std::vector<double>& values, double sigma_in_samples) {
  const int reach = static_cast<int>(std::ceil(3.0 * sigma_in_samples));
  const int last = static_cast<int>(values.size()) - 1;
  std::vector<double> kernel;
  double total = 0.0;
  for (int k = -reach; k <= reach; ++k) {
    kernel.push_back(std::exp(-0.5 * std::pow(k / sigma_in_samples, 2)));
    total += kernel.back();
  }
  std::vector<double> result(values.size(), 0.0);
  for (int i = 0; i <= last; ++i) {
    for (int k = -reach; k <= reach; ++k) {
      result[static_cast<std::size_t>(i)] += kernel[static_cast<std::size_t>(k + reach)] / total *
                                             values[static_cast<std::size_t>(std::clamp(i + k, 0, last))];
    }
  }
  return result;
}

/// Sum of three sines with random frequencies and phases, amplitude about `size`.
struct Wobble {
  std::array<double, 3> amplitude, frequency, phase;

  Wobble(double size, double low_hz, double high_hz, Random* random) {
    for (std::size_t i = 0; i < 3; ++i) {
      amplitude[i] = size * random->uniform(0.3, 0.7);
      frequency[i] = random->uniform(low_hz, high_hz);
      phase[i] = random->uniform(0.0, 2.0 * M_PI);
    }
  }
  double at(double t) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < 3; ++i)
      sum += amplitude[i] * std::sin(2.0 * M_PI * frequency[i] * t + phase[i]);
    return sum;
  }
};

}  // namespace

std::vector<double> plan_progress(const Route& route, const MotionSettings& motion, double start,
                                  double duration, double period) {
  const std::vector<double> limits = speed_limits(route, motion, start, motion.speed_mps * (duration + 5.0));
  const std::size_t count = static_cast<std::size_t>(duration / period) + 2;
  const bool moving_start = motion.start_speed_mps > 0.0;
  std::vector<double> speeds(count, 0.0);
  double s = 0.0;
  double speed = motion.start_speed_mps;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = period * static_cast<double>(i);
    // The smoothing below reaches back in time, so leave it room before the end of the standstill.
    if (moving_start || t > motion.stand_s + 3.0 * kSpeedSmoothing) {
      const std::size_t index = std::min(static_cast<std::size_t>(s / kStep), limits.size() - 1);
      const double u = std::min(s / kStep - static_cast<double>(index), 1.0);
      const double limit = (1.0 - u) * limits[index] + u * limits[std::min(index + 1, limits.size() - 1)];
      speed = std::min(speed + motion.max_acceleration * period, limit);
    }
    speeds[i] = speed;
    s += speed * period;
  }
  speeds = gaussian_smoothed(speeds, kSpeedSmoothing / period);
  std::vector<double> progress(count, start);
  for (std::size_t i = 1; i < count; ++i)
    progress[i] = progress[i - 1] + 0.5 * period * (speeds[i - 1] + speeds[i]);
  return progress;
}

Trajectory walk(const Route& route, const Ground& ground, const MotionSettings& motion, double start,
                double duration, std::uint64_t seed) {
  constexpr double kMeanHz = 0.65;  // of the hand's movements
  constexpr double kPitchLimit = 0.6;
  const std::vector<double> progress =
      plan_progress(route, motion, start, duration + kLookaheadS, kKnotPeriod);
  Random random(seed, kStreamMotion);
  // The peak of the three axes together, with the turns of the way, is about 1.8 times that of one mean sine.
  const double size = motion.shake_rad_s / (1.8 * 2.0 * M_PI * kMeanHz);
  const Wobble yaw(size, 0.3, 1.0, &random);
  const Wobble pitch(std::min(0.5 * size, kPitchLimit), 0.3, 1.0, &random);
  const Wobble roll(0.35 * size, 0.3, 1.0, &random);
  const Wobble sway(0.03, 0.4, 1.1, &random);
  const double step_hz = random.uniform(1.7, 2.1);
  std::vector<PoseVector> poses;
  for (std::size_t i = 0; i < progress.size(); ++i) {
    const double t = kKnotPeriod * static_cast<double>(i);
    const double speed = i > 0 ? (progress[i] - progress[i - 1]) / kKnotPeriod : motion.start_speed_mps;
    const double amount = std::tanh(2.0 * speed / motion.speed_mps);
    const Route::Point point = route.at(progress[i]);
    const double bob = 0.025 * std::sin(2.0 * M_PI * step_hz * t);
    PoseVector pose;
    pose << point.position.x(), point.position.y(),
        ground(point.position.x(), point.position.y()) + motion.imu_height_m + amount * (bob + sway.at(t)),
        amount * roll.at(t), amount * pitch.at(t), point.heading + amount * yaw.at(t);
    poses.push_back(pose);
  }
  return Trajectory(std::move(poses), kKnotPeriod);
}

Trajectory drive(const Route& route, const Ground& ground, const MotionSettings& motion, double start,
                 double duration, std::uint64_t seed) {
  if (motion.type == "handheld") return walk(route, ground, motion, start, duration, seed);
  constexpr double kDegree = M_PI / 180.0;
  constexpr double kHalfWheelbase = 1.4;
  constexpr double kHalfTrack = 0.8;
  const std::vector<double> progress =
      plan_progress(route, motion, start, duration + kLookaheadS, kKnotPeriod);
  Random random(seed, kStreamMotion);
  const Wobble roll(0.35 * kDegree * motion.vibration, 0.7, 2.2, &random);
  const Wobble pitch(0.3 * kDegree * motion.vibration, 0.8, 2.5, &random);
  const Wobble heave(0.006 * motion.vibration, 0.9, 3.0, &random);
  const Wobble drift(0.12, 0.03, 0.12, &random);  // nobody drives exactly in the middle of the lane
  std::vector<PoseVector> poses;
  for (std::size_t i = 0; i < progress.size(); ++i) {
    const double t = kKnotPeriod * static_cast<double>(i);
    const double speed = i > 0 ? (progress[i] - progress[i - 1]) / kKnotPeriod : motion.start_speed_mps;
    const double amount = std::tanh(speed / 4.0);  // nothing shakes while standing
    const Route::Point point = route.at(progress[i]);
    const Eigen::Vector2d ahead(std::cos(point.heading), std::sin(point.heading));
    const Eigen::Vector2d left(-ahead.y(), ahead.x());
    const Eigen::Vector2d centre = point.position + drift.at(progress[i] / 12.0) * left;
    const auto height = [&](double along, double aside) {
      const Eigen::Vector2d p = centre + along * ahead + aside * left;
      return ground(p.x(), p.y());
    };
    const double front = height(kHalfWheelbase, 0.0), rear = height(-kHalfWheelbase, 0.0);
    const double port = height(0.0, kHalfTrack), starboard = height(0.0, -kHalfTrack);
    PoseVector pose;
    pose << centre, 0.5 * (front + rear) + motion.imu_height_m + amount * heave.at(t),
        std::atan2(port - starboard, 2.0 * kHalfTrack) + amount * roll.at(t),
        std::atan2(rear - front, 2.0 * kHalfWheelbase) + amount * pitch.at(t), point.heading;
    poses.push_back(pose);
  }
  return Trajectory(std::move(poses), kKnotPeriod);
}

}  // namespace fdi_lio::simulation
