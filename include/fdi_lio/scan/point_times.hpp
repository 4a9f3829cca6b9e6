#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/cloud_layout.hpp"

namespace fdi_lio::scan {

/// The time field of one cloud, in the driver's own units. Times of kept points are relative to the first of
/// them, formed in integers where the field is an integer, so that absolute times keep their nanoseconds.
class RawTimes {
 public:
  /// `field` must outlive this; null: the cloud has no time, and nothing is kept. At most `points` are kept.
  RawTimes(const RawField* field, std::size_t points);

  /// Notes the time of a point that is kept. False, with nothing noted, when its time is not finite.
  bool keep(const std::uint8_t* point) {
    if (field_ == nullptr) return true;
    const std::uint8_t* at = point + field_->offset;
    if (is_integer_) {
      kept_.push_back(integers_.keep(load_integer(at, field_->datatype)));
      return true;
    }
    const double value = load_real(at, field_->datatype);
    if (!std::isfinite(value)) return false;
    kept_.push_back(reals_.keep(value));
    return true;
  }

  /// Notes the time of a point that is not kept: the header stamp may be that of the first or last one fired,
  /// whether it gave a return or not.
  void drop(const std::uint8_t* point) {
    if (field_ == nullptr) return;
    const std::uint8_t* at = point + field_->offset;
    if (is_integer_) {
      integers_.drop(load_integer(at, field_->datatype));
    } else if (const double value = load_real(at, field_->datatype); std::isfinite(value)) {
      reals_.drop(value);
    }
  }

  bool is_integer() const { return is_integer_; }
  /// Times of the kept points in their order, relative to the origin.
  const std::vector<double>& kept() const { return kept_; }
  /// Smallest and largest time of the points that were not kept, relative to the origin; plus and minus
  /// infinity without any.
  double first_dropped() const { return is_integer_ ? integers_.first_dropped() : reals_.first_dropped(); }
  double last_dropped() const { return is_integer_ ? integers_.last_dropped() : reals_.last_dropped(); }
  /// The time that the others are relative to: that of the first kept point.
  double origin() const { return is_integer_ ? static_cast<double>(integers_.origin) : reals_.origin; }

  /// `since_origin` as a stamp, when one unit has `unit_ns` nanoseconds; the largest stamp when it is beyond
  /// what a stamp can hold.
  Stamp to_stamp(double since_origin, std::int64_t unit_ns) const;

 private:
  /// Times in the type that they are read in.
  template <typename T>
  struct Extent {
    T origin = 0;
    bool has_origin = false;
    T first = std::numeric_limits<T>::max();  ///< of the dropped ones
    T last = std::numeric_limits<T>::lowest();

    double keep(T value) {
      if (!has_origin) origin = value;
      has_origin = true;
      return since_origin(value);
    }
    void drop(T value) {
      first = std::min(first, value);
      last = std::max(last, value);
    }
    double since_origin(T value) const {
      if constexpr (std::is_integral_v<T>) {
        // Unsigned, because the difference of two arbitrary values may overflow.
        return static_cast<double>(
            static_cast<T>(static_cast<std::uint64_t>(value) - static_cast<std::uint64_t>(origin)));
      } else {
        return value - origin;
      }
    }
    double first_dropped() const {
      return first > last ? std::numeric_limits<double>::infinity() : since_origin(first);
    }
    double last_dropped() const {
      return first > last ? -std::numeric_limits<double>::infinity() : since_origin(last);
    }
  };

  const RawField* field_;
  bool is_integer_;
  Extent<std::int64_t> integers_;
  Extent<double> reals_;
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
