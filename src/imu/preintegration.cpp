#include "fdi_lio/imu/preintegration.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/so3.hpp"

namespace fdi_lio::imu {

namespace {

constexpr int kTheta = 0;
constexpr int kPosition = 3;
constexpr int kVelocity = 6;
constexpr int kGyroBias = 9;
constexpr int kAccelBias = 12;

/// Of the noise that readings show.
constexpr double kMargin = 3.0;

/// Noise densities of one step.
struct StepNoise {
  double gyro;
  double accel;
};

ImuSample interpolate(const ImuSample& a, const ImuSample& b, Stamp stamp) {
  const double span = seconds_between(a.stamp, b.stamp);
  const double ratio = span > 0.0 ? seconds_between(a.stamp, stamp) / span : 0.0;
  ImuSample sample;
  sample.stamp = stamp;
  sample.acceleration = a.acceleration + ratio * (b.acceleration - a.acceleration);
  sample.angular_velocity = a.angular_velocity + ratio * (b.angular_velocity - a.angular_velocity);
  return sample;
}

/// Readings at exactly `from`, within, and at exactly `to`; ends without a reading beyond them hold the
/// nearest one.
std::vector<ImuSample> clip(const std::vector<ImuSample>& samples, Stamp from, Stamp to) {
  const auto value_at = [&](Stamp stamp) {
    const auto next = std::lower_bound(samples.begin(), samples.end(), stamp,
                                       [](const ImuSample& s, Stamp value) { return s.stamp < value; });
    if (next == samples.end()) {
      ImuSample held = samples.back();
      held.stamp = stamp;
      return held;
    }
    if (next == samples.begin()) {
      ImuSample held = samples.front();
      held.stamp = stamp;
      return held;
    }
    return interpolate(*std::prev(next), *next, stamp);
  };
  std::vector<ImuSample> clipped{value_at(from)};
  for (const ImuSample& sample : samples) {
    if (sample.stamp > from && sample.stamp < to) clipped.push_back(sample);
  }
  clipped.push_back(value_at(to));
  return clipped;
}

/// Longest time in [from, to] without a reading, counting the ends.
double longest_gap(const std::vector<ImuSample>& samples, Stamp from, Stamp to) {
  Stamp last = from;
  double longest = 0.0;
  for (const ImuSample& sample : samples) {
    if (sample.stamp <= from) continue;
    longest = std::max(longest, seconds_between(last, std::min(sample.stamp, to)));
    last = std::min(sample.stamp, to);
  }
  return std::max(longest, seconds_between(last, to));
}

/// One step of Forster et al. eqs. (35) for the mean and (62)-(63) for the covariance, with midpoint rates.
void integrate_step(const ImuSample& a, const ImuSample& b, const StepNoise& noise, Preintegration* out) {
  const double dt = seconds_between(a.stamp, b.stamp);
  if (dt <= 0.0) return;
  const Eigen::Vector3d rate =
      out->errors().angular_velocity(0.5 * (a.angular_velocity + b.angular_velocity));
  const Eigen::Vector3d accel = 0.5 * (a.acceleration + b.acceleration) - out->accel_bias;
  const Eigen::Vector3d half_turn = 0.5 * dt * rate;
  // The mean attitude of the step rotates the mean acceleration: second order in dt.
  const Eigen::Matrix3d R_mid = (out->delta_q * so3::exp_q(half_turn)).toRotationMatrix();
  const Eigen::Matrix3d step_transposed = so3::exp(dt * rate).transpose();
  const Eigen::Matrix3d jr_dt = so3::right_jacobian(dt * rate) * dt;
  const Eigen::Matrix3d R_accel_hat = R_mid * so3::hat(accel);
  const double half_dt_sq = 0.5 * dt * dt;

  Matrix9d A = Matrix9d::Identity();
  A.block<3, 3>(kTheta, kTheta) = step_transposed;
  A.block<3, 3>(kPosition, kTheta) = -half_dt_sq * R_accel_hat;
  A.block<3, 3>(kPosition, kVelocity) = dt * Eigen::Matrix3d::Identity();
  A.block<3, 3>(kVelocity, kTheta) = -dt * R_accel_hat;
  const double gyro_variance = noise.gyro * noise.gyro / dt;
  const double accel_variance = noise.accel * noise.accel / dt;
  Eigen::Matrix<double, 9, 3> B_accel = Eigen::Matrix<double, 9, 3>::Zero();
  B_accel.block<3, 3>(kPosition, 0) = half_dt_sq * R_mid;
  B_accel.block<3, 3>(kVelocity, 0) = dt * R_mid;
  Matrix9d covariance = A * out->covariance.topLeftCorner<9, 9>() * A.transpose();
  covariance.block<3, 3>(kTheta, kTheta) += gyro_variance * jr_dt * jr_dt.transpose();
  covariance += accel_variance * B_accel * B_accel.transpose();
  out->covariance.topLeftCorner<9, 9>() = covariance;

  // Bias Jacobians before the mean is moved: each uses the values at the start of the step.
  const Eigen::Matrix3d dq_mid =
      so3::exp(half_turn).transpose() * out->dq_dbg - so3::right_jacobian(half_turn) * (0.5 * dt);
  out->dp_dbg += dt * out->dv_dbg - half_dt_sq * R_accel_hat * dq_mid;
  out->dp_dba += dt * out->dv_dba - half_dt_sq * R_mid;
  out->dv_dbg -= dt * R_accel_hat * dq_mid;
  out->dv_dba -= dt * R_mid;
  out->dq_dbg = step_transposed * out->dq_dbg - jr_dt;

  out->delta_p += dt * out->delta_v + half_dt_sq * (R_mid * accel);
  out->delta_v += dt * (R_mid * accel);
  out->delta_q = (out->delta_q * so3::exp_q(dt * rate)).normalized();
}

/// How the rate changes from the begin to the end of the interval, in the axes of its end: readings that are
/// later by d take what comes after the end and leave out what came after the begin, Exp(-d w_from) delta_q
/// Exp(d w_to). Means over the first and the last quarter tell it, carried on to the ends: two single
/// readings would, by their noise, seem to tell the time of a sensor that does not turn. For the same reason
/// the change is shortened by twice what noise alone would give (as James and Stein's estimator is, whose
/// positive part alone still lets a third of the noise pass).
Eigen::Vector3d change_of_rate(const std::vector<ImuSample>& clipped, const Preintegration& interval,
                               double gyro_noise) {
  const double quarter_s = 0.25 * interval.duration_s();
  struct Mean {
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();
    double time_s = 0.0;
    double count = 0.0;
    void add(const ImuSample& sample, Stamp origin) {
      rate += sample.angular_velocity;
      time_s += seconds_between(origin, sample.stamp);
      ++count;
    }
  } first, last;
  for (const ImuSample& sample : clipped) {
    if (seconds_between(interval.from, sample.stamp) <= quarter_s) first.add(sample, interval.from);
    if (seconds_between(sample.stamp, interval.to) <= quarter_s) last.add(sample, interval.from);
  }
  const double between_s = last.time_s / last.count - first.time_s / first.count;
  if (between_s <= 0.0) return Eigen::Vector3d::Zero();
  const ImuErrors errors = interval.errors();
  const Eigen::Vector3d change =
      errors.angular_velocity(last.rate / last.count) -
      interval.delta_q.conjugate() * errors.angular_velocity(first.rate / first.count);
  const double step_s = interval.duration_s() / static_cast<double>(clipped.size() - 1);
  const double noise_sq =
      4.0 * 3.0 * gyro_noise * gyro_noise / step_s * (1.0 / first.count + 1.0 / last.count);
  if (change.squaredNorm() <= noise_sq) return Eigen::Vector3d::Zero();
  const double kept = 1.0 - noise_sq / change.squaredNorm();
  return change * (kept * interval.duration_s() / between_s);
}

}  // namespace

bool is_shaken(const SensorConfig& sensor, const ImuStatistics& recent) {
  return recent.angular_velocity_noise > kMargin * sensor.gyro_noise ||
         recent.acceleration_noise > kMargin * sensor.accel_noise;
}

ImuNoise noise_of(const SensorConfig& sensor, const ImuStatistics& recent) {
  ImuNoise noise;
  noise.gyro = std::max(sensor.gyro_noise, kMargin * recent.angular_velocity_noise);
  noise.accel = std::max(sensor.accel_noise, kMargin * recent.acceleration_noise);
  noise.gyro_bias_walk = sensor.gyro_bias_walk;
  noise.accel_bias_walk = std::hypot(sensor.accel_bias_walk, sensor.accel_model_walk);
  noise.gyro_seen = recent.angular_velocity_noise;
  return noise;
}

namespace {

/// Noise of held velocity: white acceleration over dt.
void set_translation_noise(double dt, double accel_noise, Matrix15d* covariance) {
  const double q = accel_noise * accel_noise;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  covariance->block<3, 3>(kPosition, kPosition) = q * dt * dt * dt / 3.0 * I;
  covariance->block<3, 3>(kPosition, kVelocity) = q * dt * dt / 2.0 * I;
  covariance->block<3, 3>(kVelocity, kPosition) = q * dt * dt / 2.0 * I;
  covariance->block<3, 3>(kVelocity, kVelocity) = q * dt * I;
}

/// Biases that are not observed stay where they are.
constexpr double kIdleBiasVariance = 1e-8;

}  // namespace

Preintegration constant_velocity(const NavState& state, Stamp to, const ImuConfig& config) {
  Preintegration out;
  out.from = state.stamp;
  out.to = to;
  out.gyro_bias = state.gyro_bias;
  out.accel_bias = state.accel_bias;
  out.gyro_scale = state.gyro_scale;
  const double dt = std::max(1e-6, out.duration_s());
  out.delta_q = so3::exp_q(dt * state.w_imu);
  out.covariance = kIdleBiasVariance * dt * Matrix15d::Identity();
  set_translation_noise(dt, config.virtual_accel_noise, &out.covariance);
  // The rate walks from its last mean value, which was half an interval earlier: variance q dt^3 (1/3 + 1/2 +
  // ...) ~ q dt^3.
  const double q = config.virtual_angular_accel_noise * config.virtual_angular_accel_noise;
  out.covariance.topLeftCorner<3, 3>() = q * dt * dt * dt * Eigen::Matrix3d::Identity();
  out.longest_gap_s = dt;
  out.last_angular_velocity = state.w_imu + state.gyro_bias;
  return out;
}

Preintegration gyro_only(const Preintegration& measured, const ImuConfig& config) {
  Preintegration out = measured;
  const double dt = std::max(1e-6, out.duration_s());
  out.delta_v.setZero();
  out.delta_p.setZero();
  out.dv_dbg.setZero();
  out.dv_dba.setZero();
  out.dp_dbg.setZero();
  out.dp_dba.setZero();
  out.covariance = kIdleBiasVariance * dt * Matrix15d::Identity();
  out.covariance.topLeftCorner<3, 3>() = measured.covariance.topLeftCorner<3, 3>();
  out.covariance.block<3, 3>(kGyroBias, kGyroBias) = measured.covariance.block<3, 3>(kGyroBias, kGyroBias);
  set_translation_noise(dt, config.virtual_accel_noise, &out.covariance);
  return out;
}

Preintegration preintegrate(const std::vector<ImuSample>& samples, Stamp from, Stamp to,
                            const ImuErrors& errors, const ImuNoise& noise, const ImuConfig& config) {
  Preintegration out;
  out.from = from;
  out.to = to;
  out.gyro_bias = errors.gyro_bias;
  out.accel_bias = errors.accel_bias;
  out.gyro_scale = errors.gyro_scale;
  out.lidar_time_offset_s = errors.lidar_time_offset_s;
  if (samples.empty()) {
    out.longest_gap_s = seconds_between(from, to);
    return out;
  }
  const std::vector<ImuSample> clipped = clip(samples, from, to);
  for (std::size_t i = 1; i < clipped.size(); ++i) {
    const bool is_gap = seconds_between(clipped[i - 1].stamp, clipped[i].stamp) > config.max_gap_s;
    const StepNoise step = is_gap ? StepNoise{config.gap_gyro_noise, config.gap_accel_noise}
                                  : StepNoise{noise.gyro, noise.accel};
    integrate_step(clipped[i - 1], clipped[i], step, &out);
  }
  const double dt = seconds_between(from, to);
  out.covariance.block<3, 3>(kGyroBias, kGyroBias) =
      noise.gyro_bias_walk * noise.gyro_bias_walk * dt * Eigen::Matrix3d::Identity();
  out.covariance.block<3, 3>(kAccelBias, kAccelBias) =
      noise.accel_bias_walk * noise.accel_bias_walk * dt * Eigen::Matrix3d::Identity();
  out.longest_gap_s = longest_gap(samples, from, to);
  out.last_angular_velocity = clipped.back().angular_velocity;
  out.dq_doffset = change_of_rate(clipped, out, noise.gyro_seen);
  for (const ImuSample& sample : samples) {
    if (sample.stamp > from && sample.stamp <= to) ++out.sample_count;
  }
  return out;
}

Preintegration with_error(const Preintegration& measured, const MotionError& error) {
  Preintegration out = measured;
  const double dt = std::max(1e-6, measured.duration_s());
  const double velocity_mps = std::hypot(error.velocity_mps, error.turn_rad * measured.delta_v.norm());
  Matrix15d noise = Matrix15d::Zero();
  set_translation_noise(dt, velocity_mps / std::sqrt(dt), &noise);
  noise.block<3, 3>(kTheta, kTheta) = error.turn_rad * error.turn_rad * Eigen::Matrix3d::Identity();
  out.covariance += noise;
  return out;
}

Preintegration with_missed_turn(const Preintegration& measured, const Eigen::Vector3d& turn) {
  Preintegration out = with_error(measured, {turn.norm(), 0.0});
  out.delta_q = (measured.delta_q * so3::exp_q(turn)).normalized();
  // What was felt at time t was turned by t / T of it: the mean of that, and twice integrated a third.
  out.delta_v = so3::exp_q(turn / 2.0) * measured.delta_v;
  out.delta_p = so3::exp_q(turn / 3.0) * measured.delta_p;
  return out;
}

Preintegration joined(const Preintegration& first, const Preintegration& second) {
  const CorrectedDelta then = corrected(second, first.errors());
  const Eigen::Matrix3d R = first.delta_q.toRotationMatrix();
  const Eigen::Matrix3d turned_back = then.delta_q.toRotationMatrix().transpose();
  const Eigen::Matrix3d R_v_hat = R * so3::hat(then.delta_v);
  const Eigen::Matrix3d R_p_hat = R * so3::hat(then.delta_p);
  const double dt = second.duration_s();

  Preintegration out = second;  // with what is said of the end
  out.from = first.from;
  out.gyro_bias = first.gyro_bias;
  out.accel_bias = first.accel_bias;
  out.gyro_scale = first.gyro_scale;
  out.lidar_time_offset_s = first.lidar_time_offset_s;
  out.delta_q = (first.delta_q * then.delta_q).normalized();
  out.delta_v = first.delta_v + R * then.delta_v;
  out.delta_p = first.delta_p + dt * first.delta_v + R * then.delta_p;
  out.dq_dbg = turned_back * first.dq_dbg + second.dq_dbg;
  out.dv_dbg = first.dv_dbg - R_v_hat * first.dq_dbg + R * second.dv_dbg;
  out.dv_dba = first.dv_dba + R * second.dv_dba;
  out.dp_dbg = first.dp_dbg + dt * first.dv_dbg - R_p_hat * first.dq_dbg + R * second.dp_dbg;
  out.dp_dba = first.dp_dba + dt * first.dv_dba + R * second.dp_dba;
  out.dq_doffset = turned_back * first.dq_doffset + second.dq_doffset;

  Matrix9d A = Matrix9d::Identity();
  A.block<3, 3>(kTheta, kTheta) = turned_back;
  A.block<3, 3>(kPosition, kTheta) = -R_p_hat;
  A.block<3, 3>(kPosition, kVelocity) = dt * Eigen::Matrix3d::Identity();
  A.block<3, 3>(kVelocity, kTheta) = -R_v_hat;
  Matrix9d B = Matrix9d::Identity();
  B.block<3, 3>(kPosition, kPosition) = R;
  B.block<3, 3>(kVelocity, kVelocity) = R;
  out.covariance = first.covariance + second.covariance;  // the walks of the biases
  out.covariance.topLeftCorner<9, 9>() = A * first.covariance.topLeftCorner<9, 9>() * A.transpose() +
                                         B * second.covariance.topLeftCorner<9, 9>() * B.transpose();
  out.sample_count = first.sample_count + second.sample_count;
  out.longest_gap_s = std::max(first.longest_gap_s, second.longest_gap_s);
  return out;
}

Eigen::Vector3d mean_reading(const Preintegration& p) {
  return so3::log(p.delta_q) / std::max(1e-6, p.duration_s()) + p.gyro_bias;
}

CorrectedDelta corrected(const Preintegration& p, const ImuErrors& errors) {
  const Eigen::Vector3d dbg =
      errors.gyro_bias - p.gyro_bias + (errors.gyro_scale - p.gyro_scale) * mean_reading(p);
  const Eigen::Vector3d dba = errors.accel_bias - p.accel_bias;
  CorrectedDelta delta;
  delta.delta_q = p.delta_q * so3::exp_q(p.dq_dbg * dbg +
                                         (errors.lidar_time_offset_s - p.lidar_time_offset_s) * p.dq_doffset);
  delta.delta_v = p.delta_v + p.dv_dbg * dbg + p.dv_dba * dba;
  delta.delta_p = p.delta_p + p.dp_dbg * dbg + p.dp_dba * dba;
  return delta;
}

NavState predict(const NavState& state, const Preintegration& p) {
  const double dt = p.duration_s();
  const CorrectedDelta delta = corrected(p, state.errors());
  const Eigen::Quaterniond q_pose_imu = so3::exp_q(state.mounting);
  const Eigen::Quaterniond q_imu = state.q_odom_imu * q_pose_imu;
  NavState next = state;
  next.stamp = p.to;
  next.q_odom_imu = (q_imu * delta.delta_q * q_pose_imu.conjugate()).normalized();
  next.v_odom = state.v_odom + dt * state.g_odom + q_imu * delta.delta_v;
  next.t_odom_imu =
      state.t_odom_imu + dt * state.v_odom + 0.5 * dt * dt * state.g_odom + q_imu * delta.delta_p;
  next.w_imu = state.errors().angular_velocity(p.last_angular_velocity);
  return next;
}

NavState predict_without_gravity(const NavState& state, const Preintegration& motion) {
  NavState from = state;
  from.g_odom.setZero();
  from.mounting.setZero();
  NavState predicted = predict(from, motion);
  predicted.g_odom = state.g_odom;
  predicted.mounting = state.mounting;
  return predicted;
}

}  // namespace fdi_lio::imu
