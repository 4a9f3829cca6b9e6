#include "fdi_lio/simulation/cloud_encoding.hpp"

#include <cmath>
#include <cstring>

namespace fdi_lio::simulation {

namespace {

constexpr std::uint8_t kUint16 = 4;
constexpr std::uint8_t kUint32 = 6;
constexpr std::uint8_t kFloat32 = 7;

template <typename T>
void put(T value, std::size_t offset, std::uint8_t* point) {
  std::memcpy(point + offset, &value, sizeof(T));
}

EncodedCloud encode_velodyne(const LidarScan& scan, bool stamp_at_end) {
  EncodedCloud cloud;
  cloud.point_step = 22;
  cloud.fields = {{"x", 0, kFloat32},          {"y", 4, kFloat32},    {"z", 8, kFloat32},
                  {"intensity", 12, kFloat32}, {"ring", 16, kUint16}, {"time", 18, kFloat32}};
  const double origin = stamp_at_end ? scan.column_time(scan.columns - 1) : 0.0;
  cloud.data.reserve(scan.returns.size() * cloud.point_step);
  std::size_t index = 0;
  for (int column = 0; column < scan.columns; ++column) {
    const auto time = static_cast<float>(scan.column_time(column) - origin);
    for (int ring = 0; ring < scan.beams; ++ring, ++index) {
      const LidarReturn& r = scan.returns[index];
      if (!r.valid) continue;
      cloud.data.resize(cloud.data.size() + cloud.point_step);
      std::uint8_t* point = cloud.data.data() + cloud.data.size() - cloud.point_step;
      for (int axis = 0; axis < 3; ++axis) put(r.p_lidar[axis], 4 * static_cast<std::size_t>(axis), point);
      put(r.intensity, 12, point);
      put(static_cast<std::uint16_t>(ring), 16, point);
      put(time, 18, point);
      cloud.labels.push_back(r.label);
    }
  }
  cloud.width = static_cast<std::uint32_t>(cloud.labels.size());
  return cloud;
}

EncodedCloud encode_ouster(const LidarScan& scan) {
  EncodedCloud cloud;
  cloud.point_step = 48;
  cloud.height = static_cast<std::uint32_t>(scan.beams);
  cloud.width = static_cast<std::uint32_t>(scan.columns);
  cloud.fields = {{"x", 0, kFloat32},          {"y", 4, kFloat32},       {"z", 8, kFloat32},
                  {"intensity", 16, kFloat32}, {"t", 20, kUint32},       {"reflectivity", 24, kUint16},
                  {"ring", 26, kUint16},       {"ambient", 28, kUint16}, {"range", 32, kUint32}};
  cloud.data.assign(scan.returns.size() * cloud.point_step, 0);
  cloud.labels.assign(scan.returns.size(), 0);
  for (int ring = 0; ring < scan.beams; ++ring) {
    for (int column = 0; column < scan.columns; ++column) {
      const LidarReturn& r =
          scan.returns[static_cast<std::size_t>(column) * static_cast<std::size_t>(scan.beams) +
                       static_cast<std::size_t>(ring)];
      const std::size_t index =
          static_cast<std::size_t>(ring) * cloud.width + static_cast<std::size_t>(column);
      std::uint8_t* point = cloud.data.data() + index * cloud.point_step;
      for (int axis = 0; axis < 3; ++axis) put(r.p_lidar[axis], 4 * static_cast<std::size_t>(axis), point);
      put(r.intensity, 16, point);
      put(static_cast<std::uint32_t>(std::llround(scan.column_time(column) * 1e9)), 20, point);
      put(r.reflectivity, 24, point);
      put(static_cast<std::uint16_t>(ring), 26, point);
      put(r.ambient, 28, point);
      put(static_cast<std::uint32_t>(std::lround(r.range_m * 1000.0f)), 32, point);
      cloud.labels[index] = r.label;
    }
  }
  return cloud;
}

}  // namespace

EncodedCloud encode_cloud(const LidarScan& scan, CloudLayout layout, bool stamp_at_end) {
  return layout == CloudLayout::kOuster ? encode_ouster(scan) : encode_velodyne(scan, stamp_at_end);
}

}  // namespace fdi_lio::simulation
