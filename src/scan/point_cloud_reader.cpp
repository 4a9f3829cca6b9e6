#include "fdi_lio/scan/point_cloud_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "fdi_lio/scan/range_limits.hpp"

namespace fdi_lio::scan {

namespace {

constexpr std::int64_t kMaxRings = 1024;
constexpr std::uint8_t kFloat32 = 7;

float load_float(const std::uint8_t* point, const RawField& field) {
  if (field.datatype == kFloat32) {  // nearly every field of nearly every driver: spares the choice by type
    float value;
    std::memcpy(&value, point + field.offset, sizeof(value));
    return value;
  }
  return static_cast<float>(load_real(point + field.offset, field.datatype));
}

/// The beam whose nominal elevation is nearest.
std::uint16_t ring_by_elevation(const Eigen::Vector3f& position, const SensorConfig& sensor) {
  const double step_deg =
      (sensor.elevation_max_deg - sensor.elevation_min_deg) / std::max(1, sensor.ring_count - 1);
  const double elevation_deg = std::asin(position.z() / position.norm()) * 180.0 / M_PI;
  const double beam = std::round((elevation_deg - sensor.elevation_min_deg) / std::max(1e-6, step_deg));
  return static_cast<std::uint16_t>(std::clamp(beam, 0.0, sensor.ring_count - 1.0));
}

std::string unit_name(std::int64_t unit_ns) {
  switch (unit_ns) {
    case 1:
      return " in ns";
    case 1000:
      return " in us";
    case 1000000:
      return " in ms";
    case 1000000000:
      return " in s";
    default:
      return "";
  }
}

}  // namespace

PointCloudReader::PointCloudReader(const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter), clock_(sensor, reporter) {}

std::optional<Scan> PointCloudReader::read(const RawCloud& cloud) {
  const CloudLayout layout = recognise_layout(cloud, sensor_.ring_count);
  if (const auto fault = find_fault(cloud, layout)) {
    reporter_->report(Severity::kWarning, fault->key, "a cloud was dropped: " + fault->text);
    return std::nullopt;
  }
  Scan scan;
  scan.has_intensity = layout.intensity != nullptr;
  scan.ring_count = static_cast<std::uint16_t>(sensor_.ring_count);
  RawTimes times(sensor_.deskew == "already_done" ? nullptr : layout.time,
                 static_cast<std::size_t>(cloud.width) * cloud.height);
  add_points(cloud, layout, &times, &scan);
  if (scan.points.empty()) {
    reporter_->report(Severity::kWarning, "cloud_useless",
                      "a cloud was dropped: none of its points can be used (" +
                          std::to_string(scan.dropped.non_finite) + " not finite in x, y, z or time, " +
                          std::to_string(scan.dropped.zero) + " at the origin, " +
                          std::to_string(scan.dropped.out_of_range) +
                          " beyond sensor.min_range, sensor.max_range or 1024 rings)");
    return std::nullopt;
  }
  if (sensor_.deskew == "already_done") {
    scan.stamp = add_seconds(cloud.stamp, sensor_.lidar_time_offset_s);
  } else if (layout.time == nullptr || !clock_.apply(times, cloud.stamp, &scan)) {
    set_times_by_azimuth(cloud.stamp, &scan);
  }
  for (const Point& point : scan.points) {
    scan.ring_count = std::max<std::uint16_t>(scan.ring_count, static_cast<std::uint16_t>(point.ring + 1));
  }
  report_layout(layout);
  return scan;
}

void PointCloudReader::add_points(const RawCloud& cloud, const CloudLayout& layout, RawTimes* times,
                                  Scan* scan) {
  const RangeLimits limits(sensor_);
  scan->points.reserve(static_cast<std::size_t>(cloud.width) * cloud.height);
  last_of_ring_.assign(kMaxRings, Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  for (std::uint32_t row = 0; row < cloud.height; ++row) {
    const std::uint8_t* at = cloud.data + row * layout.row_bytes;
    for (std::uint32_t column = 0; column < cloud.width; ++column, at += cloud.point_step) {
      Point point;
      point.position << load_float(at, *layout.x), load_float(at, *layout.y), load_float(at, *layout.z);
      if (!limits.accept(point.position, &scan->dropped) ||
          !set_ring(cloud, layout, row, at, &point, &scan->dropped)) {
        times->drop(at);
        continue;
      }
      // Both returns of a shot in dual mode are the same point when there was one surface; they are
      // neighbours on their ring, but not in the message.
      if (point.position == last_of_ring_[point.ring]) {
        ++scan->dropped.duplicate;
        times->drop(at);
        continue;
      }
      if (!times->keep(at)) {
        ++scan->dropped.non_finite;
        continue;
      }
      last_of_ring_[point.ring] = point.position;
      if (layout.intensity != nullptr) {
        point.intensity = load_float(at, *layout.intensity);
        if (!std::isfinite(point.intensity)) point.intensity = 0.0F;
      }
      scan->points.push_back(point);
    }
  }
}

bool PointCloudReader::set_ring(const RawCloud& cloud, const CloudLayout& layout, std::uint32_t row,
                                const std::uint8_t* at, Point* point, DropCounts* dropped) const {
  if (layout.ring == nullptr) {
    point->ring = layout.rows_are_rings ? static_cast<std::uint16_t>(cloud.height - 1 - row)
                                        : ring_by_elevation(point->position, sensor_);
    return true;
  }
  const std::int64_t ring = load_integer(at + layout.ring->offset, layout.ring->datatype);
  if (ring < 0 || ring >= kMaxRings) {
    ++dropped->out_of_range;
    return false;
  }
  point->ring = static_cast<std::uint16_t>(ring);
  return true;
}

void PointCloudReader::set_times_by_azimuth(Stamp header, Scan* scan) const {
  const double period = sensor_.scan_period_s;
  for (Point& point : scan->points) {
    const double turned = (M_PI - std::atan2(point.position.y(), point.position.x())) / (2.0 * M_PI);
    point.time_s = static_cast<float>(period * (turned - 1.0));
  }
  scan->stamp =
      add_seconds(header, (sensor_.stamp_at == "start" ? period : 0.0) + sensor_.lidar_time_offset_s);
  scan->duration_s = period;
  scan->has_time = true;
  scan->time_from_azimuth = true;
}

void PointCloudReader::report_layout(const CloudLayout& layout) {
  if (reporter_->has("cloud_layout")) return;
  const auto name = [](const RawField* field, const std::string& otherwise) {
    return field != nullptr ? "'" + field->name + "'" : otherwise;
  };
  std::string time = "none needed (already deskewed)";
  if (sensor_.deskew != "already_done")
    time = name(layout.time, "from the azimuth") + unit_name(layout.time != nullptr ? clock_.unit_ns() : 0);
  reporter_->report(Severity::kInfo, "cloud_layout",
                    "lidar format: ring " +
                        name(layout.ring, layout.rows_are_rings ? "from the rows" : "from the elevation") +
                        ", time " + time + ", intensity " + name(layout.intensity, "absent"));
}

}  // namespace fdi_lio::scan
