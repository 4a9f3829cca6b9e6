#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::scan {

/// One field of a cloud; `datatype` has the codes of sensor_msgs/PointField (1 int8 ... 8 float64).
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

/// Turns clouds of any driver into scans. The layout is recognised from the fields: ring as `ring`, `channel`
/// or `line`, time as `time`, `t`, `timestamp`, `time_stamp` or `offset_time`, each of any number type; the
/// unit of time follows from the span of a scan. Without ring the beam follows from the elevation, without
/// time the time from the azimuth (clockwise from behind, as KITTI's Velodyne turns). What was recognised is
/// reported once.
class PointCloudReader {
 public:
  PointCloudReader(const SensorConfig& sensor, Reporter* reporter);

  /// The scan; nothing (and a report) when the cloud cannot be used.
  std::optional<Scan> read(const RawCloud& cloud);

 private:
  struct Layout;
  bool check(const RawCloud& cloud);
  void report_layout(const Layout& layout, double seconds_per_unit);
  double seconds_per_unit(double span);
  void add_points(const RawCloud& cloud, const Layout& layout, std::vector<double>* times, Scan* scan);
  void set_times(const RawCloud& cloud, const std::vector<double>& times, bool is_integer, Scan* scan);
  void set_times_by_azimuth(const RawCloud& cloud, Scan* scan);

  SensorConfig sensor_;
  Reporter* reporter_;
  double seconds_per_unit_ = 0.0;  ///< of the time field; 0 until known
};

}  // namespace fdi_lio::scan
