#pragma once

#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/scan/cloud_layout.hpp"
#include "fdi_lio/scan/point_times.hpp"

namespace fdi_lio::scan {

/// Turns clouds of any driver into scans. The layout is recognised from the fields: ring as `ring`, `channel`
/// or `line` of any integer type, time as `time`, `t`, `timestamp`, `time_stamp` or `offset_time` of any
/// number type; the unit of time follows from the span of a scan. Without ring the beam follows from the
/// elevation, without time the time from the azimuth (clockwise from behind, as KITTI's Velodyne turns). What
/// was recognised is reported once.
class PointCloudReader {
 public:
  PointCloudReader(const SensorConfig& sensor, Reporter* reporter);

  /// The scan, in the lidar frame, stamped with its last point; nothing (and a report) when the cloud cannot
  /// be used. Points that are not finite, at the origin, out of range, of an impossible ring, or equal to the
  /// one before on their ring are dropped and counted in the scan.
  std::optional<Scan> read(const RawCloud& cloud);

 private:
  void report_layout(const CloudLayout& layout);
  void add_points(const RawCloud& cloud, const CloudLayout& layout, RawTimes* times, Scan* scan);
  bool set_ring(const RawCloud& cloud, const CloudLayout& layout, std::uint32_t row, const std::uint8_t* at,
                Point* point, DropCounts* dropped) const;
  void set_times_by_azimuth(Stamp header, Scan* scan) const;

  SensorConfig sensor_;
  Reporter* reporter_;
  PointClock clock_;
  std::vector<Eigen::Vector3f> last_of_ring_;  ///< to find duplicates; kept to save the allocation
};

}  // namespace fdi_lio::scan
