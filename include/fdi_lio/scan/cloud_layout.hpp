#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "fdi_lio/common/time.hpp"

namespace fdi_lio::scan {

/// One field of a cloud. `datatype` has the codes of sensor_msgs/PointField (1 int8 ... 8 float64) and those
/// that PCL adds to them (9 int64, 10 uint64).
struct RawField {
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t datatype = 0;
  std::uint32_t count = 1;
};

/// A view of a driver's cloud; `data` must outlive it.
struct RawCloud {
  Stamp stamp = 0;
  std::string frame_id;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t point_step = 0;
  std::uint32_t row_step = 0;
  bool is_bigendian = false;
  std::vector<RawField> fields;
  const std::uint8_t* data = nullptr;
  std::size_t data_size = 0;
};

/// Bytes of one number of `datatype`; 0 for a code that is not known.
std::size_t size_of(std::uint8_t datatype);

/// Whether `datatype` is an integer type.
bool is_integer(std::uint8_t datatype);

namespace detail {

/// Calls `use` with the number at `at`, which need not be aligned, in its own type. In the header because it
/// is called several times a point.
template <typename Use>
inline auto visit_number(const std::uint8_t* at, std::uint8_t datatype, const Use& use) {
  const auto load = [at](auto value) {
    std::memcpy(&value, at, sizeof(value));
    return value;
  };
  switch (datatype) {
    case 1:
      return use(load(std::int8_t{}));
    case 2:
      return use(load(std::uint8_t{}));
    case 3:
      return use(load(std::int16_t{}));
    case 4:
      return use(load(std::uint16_t{}));
    case 5:
      return use(load(std::int32_t{}));
    case 6:
      return use(load(std::uint32_t{}));
    case 7:
      return use(load(float{}));
    case 9:
      return use(load(std::int64_t{}));
    case 10:
      return use(load(std::uint64_t{}));
    default:
      return use(load(double{}));
  }
}

}  // namespace detail

/// The number at `at`, which need not be aligned; 64-bit integers lose what a double cannot hold.
inline double load_real(const std::uint8_t* at, std::uint8_t datatype) {
  return detail::visit_number(at, datatype, [](auto value) { return static_cast<double>(value); });
}

/// The integer at `at`, which need not be aligned; uint64 wraps. `datatype` must be an integer type.
inline std::int64_t load_integer(const std::uint8_t* at, std::uint8_t datatype) {
  return detail::visit_number(at, datatype, [](auto value) { return static_cast<std::int64_t>(value); });
}

/// Where a cloud keeps what a scan is made of: pointers into the fields of the cloud, null for what is
/// absent.
struct CloudLayout {
  const RawField* x = nullptr;
  const RawField* y = nullptr;
  const RawField* z = nullptr;
  const RawField* intensity = nullptr;  ///< `intensity`, `reflectivity` or `signal`, any number type
  const RawField* ring = nullptr;       ///< `ring`, `channel` or `line`, any integer type
  const RawField* time =
      nullptr;                  ///< `time`, `t`, `timestamp`, `time_stamp` or `offset_time`, any number type
  bool rows_are_rings = false;  ///< no ring field, but one row of the cloud a beam
  std::size_t row_bytes = 0;    ///< from one row to the next
};

/// Recognises the fields of `cloud` by name and type; `ring_count` beams are expected.
CloudLayout recognise_layout(const RawCloud& cloud, int ring_count);

/// Why a cloud cannot be read: a key to count it by, and a text for the user.
struct CloudFault {
  std::string key;
  std::string text;
};

/// The first fault that makes it impossible to read `cloud` by `layout`; nothing when every access that the
/// layout leads to lies inside the data.
std::optional<CloudFault> find_fault(const RawCloud& cloud, const CloudLayout& layout);

}  // namespace fdi_lio::scan
