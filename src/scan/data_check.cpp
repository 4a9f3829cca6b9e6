#include "fdi_lio/scan/data_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/scan/ground_plane.hpp"

namespace fdi_lio::scan {

namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr std::size_t kPointsKept = 2000;

// --- acceleration ---
constexpr double kStandardGravity = 9.80665;
/// Vibration averages out in windows of this length, rotation is hardly felt in them.
constexpr double kWindowS = 0.2;
/// Whether a unit is meant: measured over expected between 1 / kUnitRatio and kUnitRatio.
constexpr double kUnitRatio = 1.3;

// --- gyro ---
/// Spread of the gravity direction, turned by the gyro, that calls for an explanation, and one that cannot be
/// motion (a multirotor tilts without its accelerometer feeling it, but not that far).
constexpr double kSuspectSpread = 10.0 * kDegree;
constexpr double kImpossibleSpread = 35.0 * kDegree;

// --- rings ---
/// Beams that look at the sky see nothing; fewer than this share of the rings are another sensor.
constexpr double kMinRingShare = 0.4;

// --- extrinsic ---
/// Lidars are mounted with their axis closer to the vertical than this.
constexpr double kMaxLidarTilt = 45.0 * kDegree;
/// A plane with this share of the points is the ground (or ceiling).
constexpr double kGroundShare = 0.2;

std::string number(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.*f", digits, value);
  return text;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <typename Items>
std::vector<double> steps_s(const Items& items) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < items.size(); ++i)
    steps.push_back(seconds_between(items[i - 1].stamp, items[i].stamp));
  return steps;
}

/// Mean accelerations of successive windows, each reading turned into the frame of the first one by the gyro
/// times `gyro_scale` (0: not turned).
std::vector<Eigen::Vector3d> window_means(const std::deque<imu::ImuSample>& samples, double gyro_scale) {
  std::vector<Eigen::Vector3d> means;
  Eigen::Quaterniond q_first_now = Eigen::Quaterniond::Identity();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (i > 0) {
      const double dt = seconds_between(samples[i - 1].stamp, samples[i].stamp);
      const Eigen::Vector3d w = 0.5 * (samples[i - 1].angular_velocity + samples[i].angular_velocity);
      q_first_now = (q_first_now * so3::exp_q(gyro_scale * dt * w)).normalized();
    }
    sum += q_first_now * samples[i].acceleration;
    ++count;
    if (seconds_between(samples[begin].stamp, samples[i].stamp) < kWindowS) continue;
    means.push_back(sum / count);
    sum.setZero();
    count = 0;
    begin = i + 1;
    if (begin == samples.size()) break;
  }
  return means;
}

/// Root mean square angle between `vectors` and their mean; 0 for fewer than two.
double direction_spread(const std::vector<Eigen::Vector3d>& vectors) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& v : vectors) mean += v.normalized();
  double sum = 0.0;
  for (const Eigen::Vector3d& v : vectors) {
    const double angle = std::atan2(v.cross(mean).norm(), v.dot(mean));
    sum += angle * angle;
  }
  return vectors.size() < 2 ? 0.0 : std::sqrt(sum / static_cast<double>(vectors.size()));
}

bool is_about(double measured, double expected) {
  return measured > expected / kUnitRatio && measured < expected * kUnitRatio;
}

/// What to say of a typical |acceleration| of `sent` that is neither m/s^2 nor g.
std::string unknown_unit(double sent) {
  return std::string(is_about(sent, 1000.0) ? "it is in milli-g" : "it is in no known unit") +
         ", let the IMU's driver send m/s^2 or g";
}

}  // namespace

bool report_findings(const std::vector<Finding>& findings, Reporter* reporter) {
  bool has_error = false;
  for (const Finding& finding : findings) {
    reporter->report(finding.severity, "check_" + finding.key, finding.text);
    has_error = has_error || finding.severity == Severity::kError;
  }
  return has_error;
}

DataCheck::DataCheck(const Config& config) : config_(config), imu_(config.sensor, &imu_reporter_) {}

void DataCheck::add_imu(const imu::ImuSample& sample) {
  if (has_jumped_) return;
  ++readings_;
  if (!sample.acceleration.allFinite() || !sample.angular_velocity.allFinite()) {
    ++non_finite_;
    return;
  }
  if (!imu_.is_possible(sample)) {
    impossible_.push_back(sample);
    return;
  }
  const StampVerdict verdict = imu_guard_.check(sample.stamp);
  if (verdict != StampVerdict::kAccept) ++unordered_;
  has_jumped_ = verdict == StampVerdict::kRestart;
  if (verdict != StampVerdict::kAccept) return;
  imu_.add(sample);
  if (sample.acceleration.norm() > 0.0)
    scale_ = imu_.samples().back().acceleration.norm() / sample.acceleration.norm();
}

void DataCheck::add_scan(const Scan& scan) {
  if (has_jumped_) return;
  const StampVerdict verdict = scan_guard_.check(scan.stamp);
  if (verdict != StampVerdict::kAccept) ++unordered_scans_;
  has_jumped_ = verdict == StampVerdict::kRestart;
  if (verdict != StampVerdict::kAccept) return;
  ScanSummary summary{scan.stamp, scan.duration_s, scan.has_time, scan.time_from_azimuth, {}};
  // An odd step meets every ring, whatever the order of the points.
  const std::size_t step = (scan.points.size() / kPointsKept) | 1U;
  for (std::size_t i = 0; i < scan.points.size(); i += step)
    summary.points.push_back(scan.points[i].position);
  for (const Point& point : scan.points) rings_.insert(point.ring);
  scans_.push_back(std::move(summary));
}

void DataCheck::set_extrinsic(const Eigen::Isometry3d& T_imu_lidar) {
  config_.sensor.t_imu_lidar = T_imu_lidar.translation();
  config_.sensor.q_imu_lidar = Eigen::Quaterniond(T_imu_lidar.rotation());
}

std::vector<Finding> DataCheck::findings() const {
  Findings findings;
  check_readings(&findings);
  check_limits(&findings);
  check_imu_rate(&findings);
  check_acceleration(&findings);
  check_gyro_unit(&findings);
  check_scan_period(&findings);
  check_clocks(&findings);
  check_point_times(&findings);
  check_rings(&findings);
  check_extrinsic(&findings);
  std::stable_sort(findings.begin(), findings.end(),
                   [](const Finding& a, const Finding& b) { return a.severity > b.severity; });
  return findings;
}

void DataCheck::check_readings(Findings* findings) const {
  if (scans_.empty()) {
    findings->push_back({Severity::kWarning, "no_scan",
                         "no usable scan on " + config_.sensor.points_topic + " in the first " +
                             number(config_.check.duration_s, 1) +
                             " s: little could be checked; a longer check.duration may help"});
  }
  if (has_jumped_) {
    findings->push_back({Severity::kWarning, "jump",
                         "the stamps jump by more than 10 s: only what comes before was checked; was the "
                         "recording started twice, or a clock set?"});
  }
  if (unordered_scans_ > 0) {
    findings->push_back({Severity::kWarning, "scan_order",
                         std::to_string(unordered_scans_) +
                             " scans have stamps that are repeated, out of order or far from the others, and "
                             "will be dropped: check that only one driver publishes on " +
                             config_.sensor.points_topic});
  }
  if (config_.sensor.imu_topic.empty()) return;
  if (imu_.empty() && impossible_.empty()) {
    findings->push_back({Severity::kWarning, "no_imu",
                         "no usable IMU reading on " + config_.sensor.imu_topic + " in the first " +
                             number(config_.check.duration_s, 1) +
                             " s: without an IMU fast motion is not compensated; check sensor.imu_topic, or "
                             "leave it empty to work with the lidar alone"});
  }
  const std::string of_all = " of " + std::to_string(readings_) + " IMU readings ";
  if (non_finite_ > 0) {
    findings->push_back({Severity::kWarning, "imu_non_finite",
                         std::to_string(non_finite_) + of_all +
                             "are NaN or infinite and will be dropped: check the IMU's driver"});
  }
  if (unordered_ > 0) {
    findings->push_back(
        {Severity::kWarning, "imu_order",
         std::to_string(unordered_) + of_all +
             "have stamps that are repeated, out of order or far from the others, and will be "
             "dropped: check that only one driver publishes on " +
             config_.sensor.imu_topic});
  }
}

void DataCheck::check_limits(Findings* findings) const {
  if (impossible_.empty()) return;
  std::vector<double> accelerations;
  std::vector<double> rates;
  for (const imu::ImuSample& sample : impossible_) {
    accelerations.push_back(sample.acceleration.norm());
    rates.push_back(sample.angular_velocity.norm());
  }
  const std::string text = std::to_string(impossible_.size()) + " of " + std::to_string(readings_) +
                           " IMU readings are beyond what a sensor measures (sensor.max_acceleration " +
                           number(config_.sensor.max_acceleration_mps2, 0) +
                           " m/s^2, sensor.max_angular_rate " +
                           number(config_.sensor.max_angular_rate_radps, 0) + " rad/s) and will be dropped: ";
  if (2 * impossible_.size() < readings_) {
    findings->push_back({Severity::kWarning, "imu_limit",
                         text + "the largest are " +
                             number(*std::max_element(accelerations.begin(), accelerations.end()), 1) +
                             " and " + number(*std::max_element(rates.begin(), rates.end()), 1) +
                             " as the IMU sends them; check its cable and driver"});
  } else if (median(rates) > config_.sensor.max_angular_rate_radps) {
    findings->push_back({Severity::kError, "gyro_unit",
                         text + "the gyro says " + number(median(rates), 2) +
                             " (median), it seems to send deg/s; let the IMU's driver send rad/s"});
  } else {
    const double sent = median(accelerations);
    findings->push_back({Severity::kError, "imu_unit",
                         text + "|acceleration| is " + number(sent, 2) + " (median) as the IMU sends it, " +
                             unknown_unit(sent)});
  }
}

void DataCheck::check_imu_rate(Findings* findings) const {
  if (imu_.samples().size() < 2) return;
  const double rate_hz = 1.0 / median(steps_s(imu_.samples()));
  if (rate_hz >= config_.check.min_imu_rate_hz && rate_hz <= config_.check.max_imu_rate_hz) return;
  findings->push_back(
      {Severity::kWarning, "imu_rate",
       "the IMU has " + number(rate_hz, 1) + " Hz, expected are " + number(config_.check.min_imu_rate_hz, 0) +
           " to " + number(config_.check.max_imu_rate_hz, 0) +
           " Hz (check.min_imu_rate, check.max_imu_rate): change the rate in the IMU's driver"});
}

void DataCheck::check_acceleration(Findings* findings) const {
  const std::vector<Eigen::Vector3d> means = window_means(imu_.samples(), 0.0);
  if (means.empty()) return;
  // The median of the windows: a jolt when the sensor is switched on is no other unit.
  std::vector<double> norms;
  for (const Eigen::Vector3d& mean : means) norms.push_back(mean.norm());
  const double used = median(norms);
  const double sent = used / scale_;
  const double expected = config_.sensor.gravity_mps2;
  if (std::abs(used - expected) <= config_.check.gravity_tolerance_mps2) return;
  const std::string& unit = config_.sensor.acceleration_unit;
  const std::string text = "mean |acceleration| is " + number(sent, 2) + " as the IMU sends it, which with " +
                           "sensor.acceleration_unit " + unit + " is " + number(used, 2) + " m/s^2 where " +
                           number(expected, 2) + " is expected: ";
  if (is_about(sent, 1.0)) {
    findings->push_back(
        {Severity::kError, "imu_unit", text + "it is in g, set sensor.acceleration_unit to g"});
  } else if (is_about(sent, kStandardGravity) && unit != "m/s^2") {
    findings->push_back({Severity::kError, "imu_unit",
                         text + "it is in m/s^2 already, set sensor.acceleration_unit to m/s^2"});
  } else if (!is_about(used, expected)) {
    findings->push_back({Severity::kError, "imu_unit", text + unknown_unit(sent)});
  } else {
    findings->push_back({Severity::kWarning, "gravity",
                         text + "calibrate the accelerometer, or start when nothing accelerates "
                                "(check.gravity_tolerance)"});
  }
}

void DataCheck::check_gyro_unit(Findings* findings) const {
  if (imu_.empty()) return;
  std::vector<double> rates;
  for (const imu::ImuSample& sample : imu_.samples()) rates.push_back(sample.angular_velocity.norm());
  const double rate = median(rates);
  const double spread = direction_spread(window_means(imu_.samples(), 1.0));
  const double spread_deg_unit = direction_spread(window_means(imu_.samples(), kDegree));
  // Turned by a gyro in the right unit, gravity keeps its direction.
  const bool fits_degrees = spread > kSuspectSpread && spread_deg_unit < spread / 3.0;
  const bool is_too_fast = rate > config_.check.max_angular_rate_radps;
  if (!fits_degrees && !is_too_fast) return;
  std::string text = "the gyro says " + number(rate, 2) + " rad/s (median)";
  if (is_too_fast)
    text += ", more than check.max_angular_rate (" + number(config_.check.max_angular_rate_radps, 1) + ")";
  if (fits_degrees) {
    text += ", which turns the measured gravity by " + number(spread / kDegree, 0) +
            " deg, while read as deg/s it keeps it within " + number(spread_deg_unit / kDegree, 0) + " deg";
  }
  const bool is_error = is_too_fast || spread > kImpossibleSpread;
  findings->push_back({is_error ? Severity::kError : Severity::kWarning, "gyro_unit",
                       text + ": it seems to send deg/s, let the IMU's driver send rad/s"});
}

void DataCheck::check_scan_period(Findings* findings) const {
  if (scans_.size() < 3) return;
  const double interval_s = median(steps_s(scans_));
  const double period_s = config_.sensor.scan_period_s;
  const double tolerance = config_.check.period_tolerance;
  if (std::abs(interval_s / period_s - 1.0) <= tolerance) return;
  std::string text = "scans come every " + number(interval_s, 4) + " s, sensor.scan_period is " +
                     number(period_s, 4) + " s: ";
  std::vector<double> sweeps;
  for (const ScanSummary& scan : scans_) sweeps.push_back(scan.time_from_azimuth ? 0.0 : scan.duration_s);
  const double sweep_s = median(sweeps);
  if (interval_s > period_s && std::abs(sweep_s / period_s - 1.0) <= 2.0 * tolerance) {
    text += "each sweeps " + number(sweep_s, 4) + " s, so scans between them are missing; record all of them";
  } else {
    text += "set sensor.scan_period to " + number(interval_s, 3);
  }
  findings->push_back({Severity::kWarning, "scan_period", text});
}

void DataCheck::check_clocks(Findings* findings) const {
  if (scans_.size() < 2 || imu_.samples().size() < 2) return;
  const Stamp scan_begin = add_seconds(scans_.front().stamp, -scans_.front().duration_s);
  const Stamp scan_end = scans_.back().stamp;
  const Stamp imu_begin = imu_.samples().front().stamp;
  const double scans_s = seconds_between(scan_begin, scan_end);
  const double overlap_s =
      seconds_between(std::max(scan_begin, imu_begin), std::min(scan_end, imu_.newest()));
  if (overlap_s >= config_.check.min_overlap * scans_s) return;
  // What is received together ends together.
  const double offset_s = seconds_between(scan_end, imu_.newest());
  const std::string times = "scans from " + stamp_text(scan_begin) + " to " + stamp_text(scan_end) +
                            ", IMU from " + stamp_text(imu_begin) + " to " + stamp_text(imu_.newest());
  if (overlap_s <= 0.0) {
    findings->push_back(
        {Severity::kError, "clocks",
         "the clocks of lidar and IMU have no time in common (" + times + "): the IMU is " +
             number(offset_s, 2) +
             " s ahead. Let both stamp by one clock (PTP, or the host's time), set sensor.time_source to "
             "receive "
             "if the lidar's clock starts with the lidar, or add this to sensor.lidar_time_offset if it is "
             "constant"});
    return;
  }
  findings->push_back({Severity::kWarning, "clocks",
                       "the IMU covers only " + number(100.0 * overlap_s / scans_s, 0) + " % of the scans (" +
                           times + "): if it did not merely start later or pause, its clock is about " +
                           number(offset_s, 2) + " s ahead; see sensor.lidar_time_offset"});
}

void DataCheck::check_point_times(Findings* findings) const {
  if (scans_.empty() || config_.sensor.deskew == "already_done") return;
  const std::string advice =
      " If the points are compensated already, set sensor.deskew to already_done; else let the driver send "
      "them";
  if (scans_.back().time_from_azimuth) {
    findings->push_back(
        {Severity::kWarning, "point_time",
         "the clouds have no usable time for each point: it is guessed from the azimuth, which "
         "is right only for a lidar that turns clockwise from behind." +
             advice});
  } else if (!scans_.back().has_time) {
    findings->push_back(
        {Severity::kWarning, "point_time",
         "all points of a cloud have the same time: motion within a scan is not compensated." + advice});
  }
}

void DataCheck::check_rings(Findings* findings) const {
  if (rings_.empty()) return;
  const int highest = *rings_.rbegin() + 1;
  const int expected = config_.sensor.ring_count;
  const auto seen = static_cast<int>(rings_.size());
  if (highest <= expected && seen >= kMinRingShare * expected) return;
  findings->push_back({Severity::kWarning, "rings",
                       "the scans have " + std::to_string(seen) + " rings, the highest is number " +
                           std::to_string(highest) + ", sensor.ring_count is " + std::to_string(expected) +
                           ": set it (and sensor.elevation_min, sensor.elevation_max) to the lidar's"});
}

void DataCheck::check_extrinsic(Findings* findings) const {
  if (imu_.empty()) return;
  // The newest scan at which the sensor has stood still; in motion acceleration is not gravity.
  const auto stands = [this](const ScanSummary& scan) {
    return imu::is_static(imu_.statistics(scan.stamp, config_.imu.static_duration_s), config_.imu);
  };
  const auto scan = std::find_if(scans_.rbegin(), scans_.rend(), stands);
  if (scan == scans_.rend()) return;
  const Eigen::Vector3d up = (config_.sensor.q_imu_lidar.conjugate() *
                              imu_.statistics(scan->stamp, config_.imu.static_duration_s).mean_acceleration)
                                 .normalized();
  const auto larger = [](const Plane& a, const Plane& b) { return a.share >= b.share ? a : b; };
  const Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  const Plane seen =
      larger(find_plane(scan->points, axis, kMaxLidarTilt), find_plane(scan->points, -axis, kMaxLidarTilt));
  if (seen.share < kGroundShare) return;
  const double max_angle = config_.check.max_extrinsic_angle_deg * kDegree;
  const Plane floor = find_plane(scan->points, up, max_angle);
  const Plane ceiling = find_plane(scan->points, -up, max_angle);
  const std::string share = number(100.0 * seen.share, 0) + " % of the points";
  if (larger(floor, ceiling).share < 0.5 * seen.share) {
    const double angle = std::acos(std::min(1.0, std::abs(seen.normal.dot(up))));
    findings->push_back(
        {Severity::kWarning, "extrinsic",
         "by the accelerometer and sensor.T_imu_lidar the ground that the lidar sees (" + share +
             ") is tilted by " + number(angle / kDegree, 0) +
             " deg: check sensor.T_imu_lidar.rotation (p_imu = T_imu_lidar * p_lidar), also its "
             "direction; check.max_extrinsic_angle is " +
             number(config_.check.max_extrinsic_angle_deg, 0)});
  } else if (floor.share < 0.1 * ceiling.share) {
    findings->push_back(
        {Severity::kWarning, "extrinsic",
         "by the accelerometer and sensor.T_imu_lidar the plane that the lidar sees (" + share +
             ") lies above it and none below: if that is no ceiling, sensor.T_imu_lidar.rotation "
             "turns the lidar upside down"});
  }
}

}  // namespace fdi_lio::scan
