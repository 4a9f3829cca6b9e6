#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fdi_lio/simulation/lidar_simulator.hpp"

namespace fdi_lio::simulation {

/// Field of a point as in sensor_msgs/PointField; `datatype` uses its numbers (2: UINT8 ... 7: FLOAT32).
struct EncodedField {
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t datatype = 0;
};

/// What a driver puts into sensor_msgs/PointCloud2, little endian.
struct EncodedCloud {
  std::uint32_t height = 1;
  std::uint32_t width = 0;
  std::uint32_t point_step = 0;
  bool is_dense = true;
  std::vector<EncodedField> fields;
  std::vector<std::uint8_t> data;
  std::vector<std::int16_t> labels;  ///< one a point of `data`, in its order
};

/// Layout of the Velodyne driver (22 bytes, unorganised, missing points left out) or of the Ouster driver (48
/// bytes, rings x columns, missing points zero). With `stamp_at_end` times count back from the last column.
EncodedCloud encode_cloud(const LidarScan& scan, CloudLayout layout, bool stamp_at_end);

}  // namespace fdi_lio::simulation
