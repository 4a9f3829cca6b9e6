#pragma once

#include <cinttypes>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

namespace fdi_lio {

/// Sensor time in nanoseconds since the epoch of the sensor clock.
using Stamp = std::int64_t;

constexpr double kNanosecondsPerSecond = 1e9;

/// Seconds from `from` to `to`; exact to the nanosecond for any two stamps less than 100 days apart.
inline double seconds_between(Stamp from, Stamp to) {
  return static_cast<double>(to - from) / kNanosecondsPerSecond;
}

/// Nearest nanosecond of a duration in seconds.
inline Stamp to_nanoseconds(double seconds) {
  return static_cast<Stamp>(std::llround(seconds * kNanosecondsPerSecond));
}

/// `stamp` moved by a (signed) duration in seconds.
inline Stamp add_seconds(Stamp stamp, double seconds) { return stamp + to_nanoseconds(seconds); }

/// A stamp as seconds, for messages to people and for files; loses about 0.2 microseconds on today's dates.
inline double to_seconds(Stamp stamp) { return static_cast<double>(stamp) / kNanosecondsPerSecond; }

/// A non-negative stamp as decimal seconds with all nine digits, for files.
inline std::string stamp_text(Stamp stamp) {
  constexpr Stamp kBillion = 1000000000;
  char text[32];
  std::snprintf(text, sizeof(text), "%" PRId64 ".%09" PRId64, stamp / kBillion, stamp % kBillion);
  return text;
}

}  // namespace fdi_lio
