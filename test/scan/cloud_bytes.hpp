#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/scan/cloud_layout.hpp"

namespace fdi_lio::scan::test {

// Codes of sensor_msgs/PointField; kUint64 is PCL's.
constexpr std::uint8_t kInt8 = 1, kUint8 = 2, kInt16 = 3, kUint16 = 4, kInt32 = 5, kUint32 = 6, kFloat32 = 7,
                       kFloat64 = 8, kUint64 = 10;

/// A cloud put together byte by byte, one row of points.
struct CloudBytes {
  std::uint32_t point_step = 0;
  std::vector<RawField> fields;
  std::vector<std::uint8_t> bytes;

  /// Appends a point of zeros.
  void add() { bytes.resize(bytes.size() + point_step); }

  /// Writes a field of point `index` in the field's own type; does nothing when there is no such field.
  template <typename T>
  void set(std::size_t index, const std::string& name, T value) {
    for (const RawField& field : fields) {
      if (field.name == name) {
        detail::visit_number(bytes.data(), field.datatype, [&](auto number) {
          number = static_cast<decltype(number)>(value);
          std::memcpy(bytes.data() + index * point_step + field.offset, &number, sizeof(number));
        });
      }
    }
  }

  std::size_t size() const { return bytes.size() / point_step; }

  /// The message as a driver would send it; this must outlive it.
  RawCloud raw(Stamp stamp) const {
    RawCloud raw;
    raw.stamp = stamp;
    raw.frame_id = "lidar";
    raw.width = static_cast<std::uint32_t>(size());
    raw.height = 1;
    raw.point_step = point_step;
    raw.row_step = static_cast<std::uint32_t>(bytes.size());
    raw.fields = fields;
    raw.data = bytes.data();
    raw.data_size = bytes.size();
    return raw;
  }
};

/// A wall all around, seen by 16 beams from -15 to 15 degrees in columns clockwise from behind.
struct Sweep {
  static constexpr int kRings = 16;
  static constexpr int kColumns = 200;
  static constexpr double kColumnS = 0.1 / kColumns;
  static constexpr double kLastS = (kColumns - 1) * kColumnS;

  /// A place within the column: no point lies on the seam behind.
  static double azimuth(int column) { return M_PI - 2.0 * M_PI * (column + 0.25) / kColumns; }
  static double elevation(int ring) { return (2.0 * ring - 15.0) * M_PI / 180.0; }
  static Eigen::Vector3f position(int column, int ring) {
    return Eigen::Vector3d(10.0 * std::cos(azimuth(column)), 10.0 * std::sin(azimuth(column)),
                           10.0 * std::tan(elevation(ring)))
        .cast<float>();
  }
  static float intensity(int column, int ring) { return static_cast<float>((column + ring) % 100); }

  /// The sweep in the fields that there are, column by column. `time_name` gets `first + column * step`.
  template <typename T>
  static CloudBytes cloud(std::uint32_t point_step, std::vector<RawField> fields,
                          const std::string& time_name = "", T first = {}, T step = {}) {
    CloudBytes cloud;
    cloud.point_step = point_step;
    cloud.fields = std::move(fields);
    for (int column = 0; column < kColumns; ++column) {
      for (int ring = 0; ring < kRings; ++ring) {
        const std::size_t i = cloud.size();
        cloud.add();
        const Eigen::Vector3f p = position(column, ring);
        cloud.set(i, "x", p.x());
        cloud.set(i, "y", p.y());
        cloud.set(i, "z", p.z());
        for (const char* name : {"intensity", "reflectivity"}) cloud.set(i, name, intensity(column, ring));
        for (const char* name : {"ring", "line", "channel"}) cloud.set(i, name, ring);
        cloud.set(i, time_name, first + static_cast<T>(column) * step);
      }
    }
    return cloud;
  }
};

/// The layout of the Velodyne driver: `time` is not aligned.
inline std::vector<RawField> velodyne_fields() {
  return {{"x", 0, kFloat32},          {"y", 4, kFloat32},    {"z", 8, kFloat32},
          {"intensity", 12, kFloat32}, {"ring", 16, kUint16}, {"time", 18, kFloat32}};
}

inline CloudBytes velodyne_cloud() {
  return Sweep::cloud(22, velodyne_fields(), "time", 0.0, Sweep::kColumnS);
}

}  // namespace fdi_lio::scan::test
