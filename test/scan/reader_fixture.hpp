#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "cloud_bytes.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fdi_lio/scan/point_cloud_reader.hpp"

namespace fdi_lio::scan::test {

constexpr Stamp kHeader = 1700000000123456789;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

inline std::vector<RawField> xyz_and(std::vector<RawField> others) {
  std::vector<RawField> fields{{"x", 0, kFloat32}, {"y", 4, kFloat32}, {"z", 8, kFloat32}};
  fields.insert(fields.end(), others.begin(), others.end());
  return fields;
}

/// A reader for 16 beams, and what it reports.
class Reader : public testing::Test {
 protected:
  Reader() {
    sensor_.ring_count = 16;
    sensor_.elevation_min_deg = -15.0;
    sensor_.elevation_max_deg = 15.0;
  }

  std::optional<Scan> read(const RawCloud& cloud) {
    return PointCloudReader(sensor_, &reporter_).read(cloud);
  }
  std::optional<Scan> read(const CloudBytes& cloud) { return read(cloud.raw(kHeader)); }

  /// Text of the notice `key`; empty when there is none.
  std::string notice(const std::string& key) const {
    return reporter_.has(key) ? reporter_.notices().at(key).text : "";
  }

  /// Texts of all warnings and errors.
  std::string warnings() const {
    std::string text;
    for (const auto& entry : reporter_.notices()) {
      if (entry.second.severity != Severity::kInfo) text += entry.second.text + "\n";
    }
    return text;
  }

  /// Expects every point of the sweep in its order, `time_tolerance_s` about its column's time.
  void expect_sweep(const std::optional<Scan>& scan, double time_tolerance_s) {
    ASSERT_TRUE(scan) << warnings();
    EXPECT_THAT(warnings(), testing::IsEmpty());
    ASSERT_EQ(scan->points.size(), static_cast<std::size_t>(Sweep::kColumns * Sweep::kRings));
    EXPECT_EQ(scan->dropped.total(), 0U);
    EXPECT_EQ(scan->ring_count, 16);
    EXPECT_TRUE(scan->has_time);
    for (std::size_t i = 0; i < scan->points.size(); ++i) {
      const int column = static_cast<int>(i) / Sweep::kRings;
      const int ring = static_cast<int>(i) % Sweep::kRings;
      EXPECT_EQ(scan->points[i].position, Sweep::position(column, ring));
      EXPECT_EQ(scan->points[i].ring, ring);
      EXPECT_NEAR(scan->points[i].time_s, column * Sweep::kColumnS - Sweep::kLastS, time_tolerance_s);
      if (scan->has_intensity) {
        EXPECT_EQ(scan->points[i].intensity, Sweep::intensity(column, ring));
      }
    }
  }

  SensorConfig sensor_;
  Reporter reporter_;
};

}  // namespace fdi_lio::scan::test
