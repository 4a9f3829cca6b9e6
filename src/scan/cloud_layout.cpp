#include "fdi_lio/scan/cloud_layout.hpp"

#include <initializer_list>

namespace fdi_lio::scan {

namespace {

/// The first field of one of `names` that holds one number of a known type (an integer type if asked for).
const RawField* find(const RawCloud& cloud, std::initializer_list<const char*> names,
                     bool must_be_integer = false) {
  for (const char* name : names) {
    for (const RawField& field : cloud.fields) {
      if (field.name == name && size_of(field.datatype) > 0 && field.count <= 1 &&
          (!must_be_integer || is_integer(field.datatype))) {
        return &field;
      }
    }
  }
  return nullptr;
}

}  // namespace

std::size_t size_of(std::uint8_t datatype) {
  static constexpr std::size_t kSizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8, 8, 8};
  return datatype < sizeof(kSizes) / sizeof(kSizes[0]) ? kSizes[datatype] : 0;
}

bool is_integer(std::uint8_t datatype) {
  return size_of(datatype) > 0 && (datatype < 7 || datatype == 9 || datatype == 10);
}

CloudLayout recognise_layout(const RawCloud& cloud, int ring_count) {
  CloudLayout layout;
  layout.x = find(cloud, {"x"});
  layout.y = find(cloud, {"y"});
  layout.z = find(cloud, {"z"});
  layout.intensity = find(cloud, {"intensity", "reflectivity", "signal"});
  layout.ring = find(cloud, {"ring", "channel", "line"}, true);
  layout.time = find(cloud, {"time", "t", "timestamp", "time_stamp", "offset_time"});
  layout.rows_are_rings =
      layout.ring == nullptr && cloud.height > 1 && cloud.height == static_cast<std::uint32_t>(ring_count);
  const std::size_t packed = static_cast<std::size_t>(cloud.width) * cloud.point_step;
  // Some drivers leave row_step at 0, and it means nothing when there is only one row.
  layout.row_bytes = cloud.height > 1 && cloud.row_step > 0 ? cloud.row_step : packed;
  return layout;
}

std::optional<CloudFault> find_fault(const RawCloud& cloud, const CloudLayout& layout) {
  if (cloud.is_bigendian)
    return CloudFault{"cloud_endian", "it is big-endian; the driver must send little-endian clouds"};
  if (cloud.width == 0 || cloud.height == 0) return CloudFault{"cloud_empty", "it has no points"};
  for (const auto& [name, field] : {std::pair("x", layout.x), {"y", layout.y}, {"z", layout.z}}) {
    if (field == nullptr || is_integer(field->datatype)) {
      return CloudFault{"cloud_xyz",
                        std::string("its field '") + name + "' is missing or no float32 or float64"};
    }
  }
  const std::size_t step = cloud.point_step;
  for (const RawField* field : {layout.x, layout.y, layout.z, layout.intensity, layout.ring, layout.time}) {
    if (field != nullptr && field->offset + size_of(field->datatype) > step) {
      return CloudFault{"cloud_field", "its field '" + field->name + "' ends at byte " +
                                           std::to_string(field->offset + size_of(field->datatype)) +
                                           ", but a point has only " + std::to_string(step) +
                                           " bytes (point_step): the driver's message is inconsistent"};
    }
  }
  const std::size_t packed = cloud.width * step;
  if (layout.row_bytes < packed) {
    return CloudFault{"cloud_size", "its rows overlap: row_step is " + std::to_string(layout.row_bytes) +
                                        ", but " + std::to_string(cloud.width) + " points of " +
                                        std::to_string(step) + " bytes need " + std::to_string(packed)};
  }
  if (packed > cloud.data_size || (cloud.data_size - packed) / layout.row_bytes < cloud.height - 1) {
    return CloudFault{"cloud_size", std::to_string(cloud.height) + " rows of " + std::to_string(cloud.width) +
                                        " points of " + std::to_string(step) + " bytes do not fit its " +
                                        std::to_string(cloud.data_size) +
                                        " bytes of data: the message was cut off or its sizes are wrong"};
  }
  return std::nullopt;
}

}  // namespace fdi_lio::scan
