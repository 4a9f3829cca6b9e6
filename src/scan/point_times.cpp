#include "fdi_lio/scan/point_times.hpp"

#include <algorithm>
#include <cmath>

namespace fdi_lio::scan {

namespace {

constexpr std::int64_t kUnitsNs[] = {1000000000, 1000000, 1000, 1};
/// Times of one cloud that span more revolutions than this are no times of a sweep; times that lie farther
/// from zero than this are not relative to the header.
constexpr double kMaxRevolutions = 5.0;
/// A sweep between these shares of a revolution tells the unit for certain.
constexpr double kMinCertainSweep = 0.3;
constexpr double kMaxCertainSweep = 3.0;
/// Header and point times that differ by less belong to the same clock (a header may be the time of sending).
constexpr double kSameClockSeconds = 1.0;
/// Smallest negative time that says that times count back from the header, above the rounding of float32.
constexpr double kNegativeSeconds = 1e-4;

}  // namespace

RawTimes::RawTimes(const RawField* field, std::size_t points)
    : field_(field), is_integer_(field != nullptr && scan::is_integer(field->datatype)) {
  if (field != nullptr) kept_.reserve(points);
}

Stamp RawTimes::to_stamp(double since_origin, std::int64_t unit_ns) const {
  constexpr Stamp kMax = std::numeric_limits<Stamp>::max();
  const auto unit = static_cast<double>(unit_ns);
  if (std::abs(origin() * unit) + std::abs(since_origin * unit) > 9e18) return kMax;
  const Stamp origin_ns = is_integer_ ? integers_.origin * unit_ns : std::llround(reals_.origin * unit);
  return origin_ns + std::llround(since_origin * unit);
}

PointClock::PointClock(const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter) {}

void PointClock::find_unit(double span, bool is_integer) {
  if (is_unit_certain_) return;
  // The unit that makes the span of a sweep closest to the period of one revolution.
  double best = std::numeric_limits<double>::max();
  for (const std::int64_t unit_ns : kUnitsNs) {
    if (is_integer && unit_ns == kUnitsNs[0]) continue;  // whole seconds tell no two points of a sweep apart
    const double revolutions =
        span * static_cast<double>(unit_ns) / (kNanosecondsPerSecond * sensor_.scan_period_s);
    const double mismatch = std::abs(std::log(revolutions));
    if (mismatch >= best) continue;
    best = mismatch;
    unit_ns_ = unit_ns;
    is_unit_certain_ = revolutions > kMinCertainSweep && revolutions < kMaxCertainSweep;
  }
}

bool PointClock::apply(const RawTimes& times, Stamp header, Scan* scan) {
  const auto [first, last] = std::minmax_element(times.kept().begin(), times.kept().end());
  const double span = *last - *first;
  if (!(span > 0.0)) {
    if (scan->points.size() > 1) {
      reporter_->report(
          Severity::kWarning, "cloud_time_constant",
          "all points of a cloud have the same time: it is not motion-compensated. If the lidar "
          "turns, its driver must fill the times of the points");
    }
    scan->stamp = add_seconds(header, sensor_.lidar_time_offset_s);
    return true;
  }
  find_unit(span, times.is_integer());
  const double unit_s = static_cast<double>(unit_ns_) / kNanosecondsPerSecond;
  if (span * unit_s > kMaxRevolutions * sensor_.scan_period_s) {
    reporter_->report(Severity::kWarning, "cloud_time_span",
                      "the point times of a cloud span " + std::to_string(span * unit_s) +
                          " s, more than five revolutions: they are not used, check the driver and "
                          "sensor.scan_period");
    return false;
  }
  scan->stamp = add_seconds(reference_stamp(times, *first, *last, header), sensor_.lidar_time_offset_s);
  scan->duration_s = span * unit_s;
  scan->has_time = true;
  for (std::size_t i = 0; i < times.kept().size(); ++i)
    scan->points[i].time_s = static_cast<float>((times.kept()[i] - *last) * unit_s);
  return true;
}

Stamp PointClock::reference_stamp(const RawTimes& times, double first, double last, Stamp header) {
  const double unit_s = static_cast<double>(unit_ns_) / kNanosecondsPerSecond;
  const double first_s = (times.origin() + first) * unit_s;
  const double last_s = (times.origin() + last) * unit_s;
  const double limit_s = kMaxRevolutions * sensor_.scan_period_s;
  const bool is_relative = first_s >= -limit_s && last_s <= limit_s;
  // Negative times count back from the header stamp, whatever it was said to be.
  if (is_relative && (first_s < -kNegativeSeconds || sensor_.stamp_at == "start"))
    return add_seconds(header, last_s);
  if (!is_relative) {
    const Stamp absolute = times.to_stamp(last, unit_ns_);
    if (header == 0 || std::abs(to_seconds(absolute) - to_seconds(header)) < kSameClockSeconds)
      return absolute;
    reporter_->report(Severity::kInfo, "cloud_time_clock",
                      "the point times are on another clock than the header stamps (" +
                          std::to_string(to_seconds(absolute) - to_seconds(header)) +
                          " s away): the headers are used, and of the point times only the differences");
  }
  // The header belongs to the first or last point of the sweep, which may have been dropped. Points without a
  // return may have any time, so what lies outside one revolution is not believed.
  const double revolution = sensor_.scan_period_s / unit_s;
  if (sensor_.stamp_at == "start") {
    const double start = std::min(first, times.first_dropped());
    return add_seconds(header, (last - (last - start < 1.5 * revolution ? start : first)) * unit_s);
  }
  const double end = std::max(last, times.last_dropped());
  return add_seconds(header, end - last < revolution ? (last - end) * unit_s : 0.0);
}

}  // namespace fdi_lio::scan
