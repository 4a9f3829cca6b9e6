#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/cloud_layout.hpp"

namespace fdi_lio::scan {

/// The time field of one cloud, in the driver's own units. Times are kept relative to the first one, formed
/// in integers where the field is an integer, so that absolute times keep their nanoseconds.
class RawTimes {
 public:
  /// `field` must outlive this; null: the cloud has no time, nothing may be read. At most `points` are kept.
  RawTimes(const RawField* field, std::size_t points);

  /// Time of the point at `point` relative to the first one read; NaN when it is not finite.
  double read(const std::uint8_t* point) {
    return is_integer_ ? read_integer(point + field_->offset) : read_real(point + field_->offset);
  }

  /// Notes the time of a point that was kept.
  void keep(double since_origin) { kept_.push_back(since_origin); }

  /// Notes the time of a point that was not kept.
  void drop(double since_origin) {
    first_dropped_ = std::min(first_dropped_, since_origin);  // NaN changes nothing
    last_dropped_ = std::max(last_dropped_, since_origin);
  }

  bool is_integer() const { return is_integer_; }
  /// Times of the kept points in their order, relative to the origin.
  const std::vector<double>& kept() const { return kept_; }
  /// Smallest and largest time of the points that were not kept, relative to the origin; infinite without
  /// any.
  double first_dropped() const { return first_dropped_; }
  double last_dropped() const { return last_dropped_; }
  /// The time that the others are relative to.
  double origin() const { return is_integer_ ? static_cast<double>(integer_origin_) : real_origin_; }

  /// `since_origin` as a stamp, when one unit has `unit_ns` nanoseconds; the largest stamp when it is beyond
  /// what a stamp can hold.
  Stamp to_stamp(double since_origin, std::int64_t unit_ns) const;

 private:
  double read_integer(const std::uint8_t* at) {
    const std::int64_t value = load_integer(at, field_->datatype);
    if (!has_origin_) integer_origin_ = value;
    has_origin_ = true;
    // Unsigned, because the difference of two arbitrary values may overflow.
    return static_cast<double>(static_cast<std::int64_t>(static_cast<std::uint64_t>(value) -
                                                         static_cast<std::uint64_t>(integer_origin_)));
  }

  double read_real(const std::uint8_t* at) {
    const double value = load_real(at, field_->datatype);
    if (!std::isfinite(value)) return std::numeric_limits<double>::quiet_NaN();
    if (!has_origin_) real_origin_ = value;
    has_origin_ = true;
    return value - real_origin_;
  }

  const RawField* field_;
  bool is_integer_;
  bool has_origin_ = false;
  std::int64_t integer_origin_ = 0;
  double real_origin_ = 0.0;
  double first_dropped_ = std::numeric_limits<double>::infinity();
  double last_dropped_ = -std::numeric_limits<double>::infinity();
  std::vector<double> kept_;
};

/// Gives meaning to the time fields of one lidar: finds their unit (s, ms, us, ns) from the span of a scan,
/// and whether they are relative to the header stamp or absolute.
class PointClock {
 public:
  PointClock(const SensorConfig& sensor, Reporter* reporter);

  /// Sets stamp, duration and the time of every point of `scan`, whose points are those that `times` kept.
  /// `header` is the stamp of the message. False, with a report and nothing set, when the times span more
  /// than five revolutions.
  bool apply(const RawTimes& times, Stamp header, Scan* scan);

  /// Nanoseconds of one unit; 0 before the first scan.
  std::int64_t unit_ns() const { return unit_ns_; }

 private:
  void find_unit(double span, bool is_integer);
  Stamp reference_stamp(const RawTimes& times, double first, double last, Stamp header);

  SensorConfig sensor_;
  Reporter* reporter_;
  std::int64_t unit_ns_ = 0;
  bool is_unit_certain_ = false;  ///< a whole revolution has been seen
};

}  // namespace fdi_lio::scan
