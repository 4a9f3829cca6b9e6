#include "fdi_lio/scan/point_cloud_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace fdi_lio::scan {

namespace {

constexpr std::uint8_t kFloat32 = 7;

std::uint32_t size_of(std::uint8_t datatype) {
  static constexpr std::uint32_t kSizes[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
  return datatype < 9 ? kSizes[datatype] : 0;
}

template <typename T>
double load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return static_cast<double>(value);
}

double load_as(const std::uint8_t* at, std::uint8_t datatype) {
  switch (datatype) {
    case 1:
      return load<std::int8_t>(at);
    case 2:
      return load<std::uint8_t>(at);
    case 3:
      return load<std::int16_t>(at);
    case 4:
      return load<std::uint16_t>(at);
    case 5:
      return load<std::int32_t>(at);
    case 6:
      return load<std::uint32_t>(at);
    case 7:
      return load<float>(at);
    default:
      return load<double>(at);
  }
}

const RawField* find(const RawCloud& cloud, std::initializer_list<const char*> names) {
  for (const char* name : names) {
    for (const RawField& field : cloud.fields) {
      if (field.name == name && size_of(field.datatype) > 0 && field.count <= 1 &&
          field.offset + size_of(field.datatype) <= cloud.point_step) {
        return &field;
      }
    }
  }
  return nullptr;
}

bool is_integer(const RawField* field) { return field != nullptr && field->datatype < kFloat32; }

}  // namespace

struct PointCloudReader::Layout {
  const RawField* x = nullptr;
  const RawField* y = nullptr;
  const RawField* z = nullptr;
  const RawField* intensity = nullptr;
  const RawField* ring = nullptr;
  const RawField* time = nullptr;
  bool rows_are_rings = false;

  static Layout of(const RawCloud& cloud, const SensorConfig& sensor) {
    Layout layout;
    layout.x = find(cloud, {"x"});
    layout.y = find(cloud, {"y"});
    layout.z = find(cloud, {"z"});
    layout.intensity = find(cloud, {"intensity", "reflectivity", "signal"});
    layout.ring = find(cloud, {"ring", "channel", "line"});
    if (!is_integer(layout.ring)) layout.ring = nullptr;
    layout.time = find(cloud, {"time", "t", "timestamp", "time_stamp", "offset_time"});
    layout.rows_are_rings =
        layout.ring == nullptr && cloud.height == static_cast<std::uint32_t>(sensor.ring_count);
    return layout;
  }
};

PointCloudReader::PointCloudReader(const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter) {}

bool PointCloudReader::check(const RawCloud& cloud) {
  const auto refuse = [this](const std::string& key, const std::string& text) {
    reporter_->report(Severity::kWarning, key, "a cloud was dropped: " + text);
    return false;
  };
  if (cloud.is_bigendian)
    return refuse("cloud_endian", "it is big-endian; the driver must send little-endian clouds");
  const std::size_t points = static_cast<std::size_t>(cloud.width) * cloud.height;
  if (points == 0) return refuse("cloud_empty", "it has no points");
  if (cloud.point_step == 0 || points > cloud.data_size / cloud.point_step ||
      (cloud.height > 1 && cloud.row_step < cloud.width * cloud.point_step) ||
      (cloud.height > 1 && static_cast<std::size_t>(cloud.row_step) * (cloud.height - 1) +
                                   static_cast<std::size_t>(cloud.width) * cloud.point_step >
                               cloud.data_size)) {
    return refuse("cloud_size", std::to_string(points) + " points of " + std::to_string(cloud.point_step) +
                                    " bytes do not fit its " + std::to_string(cloud.data_size) +
                                    " bytes of data");
  }
  for (const char* axis : {"x", "y", "z"}) {
    const RawField* field = find(cloud, {axis});
    if (field == nullptr || field->datatype < kFloat32) {
      return refuse("cloud_xyz", std::string("its field '") + axis + "' is missing or no float32 or float64");
    }
  }
  return true;
}

std::optional<Scan> PointCloudReader::read(const RawCloud& cloud) {
  if (!check(cloud)) return std::nullopt;
  const Layout layout = Layout::of(cloud, sensor_);
  Scan scan;
  scan.has_intensity = layout.intensity != nullptr;
  scan.ring_count = static_cast<std::uint16_t>(sensor_.ring_count);
  scan.points.reserve(static_cast<std::size_t>(cloud.width) * cloud.height);
  std::vector<double> times;
  add_points(cloud, layout, &times, &scan);
  if (scan.points.empty()) {
    reporter_->report(Severity::kWarning, "cloud_useless",
                      "a cloud was dropped: none of its points can be used (" +
                          std::to_string(scan.dropped.non_finite) + " not finite, " +
                          std::to_string(scan.dropped.zero) + " at the origin, " +
                          std::to_string(scan.dropped.out_of_range) + " out of range)");
    return std::nullopt;
  }
  if (sensor_.deskew == "already_done") {
    scan.stamp = add_seconds(cloud.stamp, sensor_.lidar_time_offset_s);
  } else if (layout.time != nullptr) {
    set_times(cloud, times, is_integer(layout.time), &scan);
  } else {
    set_times_by_azimuth(cloud, &scan);
  }
  for (const Point& point : scan.points) {
    scan.ring_count = std::max<std::uint16_t>(scan.ring_count, static_cast<std::uint16_t>(point.ring + 1));
  }
  report_layout(layout, seconds_per_unit_);
  return scan;
}

void PointCloudReader::add_points(const RawCloud& cloud, const Layout& layout, std::vector<double>* times,
                                  Scan* scan) {
  const auto min_sq = static_cast<float>(sensor_.min_range_m * sensor_.min_range_m);
  const auto max_sq = static_cast<float>(sensor_.max_range_m * sensor_.max_range_m);
  const double beam_step =
      (sensor_.elevation_max_deg - sensor_.elevation_min_deg) / std::max(1, sensor_.ring_count - 1);
  Eigen::Vector3f previous = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
  for (std::uint32_t row = 0; row < cloud.height; ++row) {
    const std::uint8_t* at =
        cloud.data + static_cast<std::size_t>(row) * (cloud.height > 1 ? cloud.row_step : 0);
    for (std::uint32_t column = 0; column < cloud.width; ++column, at += cloud.point_step) {
      Point point;
      point.position << static_cast<float>(load_as(at + layout.x->offset, layout.x->datatype)),
          static_cast<float>(load_as(at + layout.y->offset, layout.y->datatype)),
          static_cast<float>(load_as(at + layout.z->offset, layout.z->datatype));
      const float range_sq = point.position.squaredNorm();
      if (!std::isfinite(range_sq)) {
        ++scan->dropped.non_finite;
        continue;
      }
      if (range_sq == 0.0F) {
        ++scan->dropped.zero;
        continue;
      }
      if (range_sq < min_sq || range_sq > max_sq) {
        ++scan->dropped.out_of_range;
        continue;
      }
      if (point.position == previous) {
        ++scan->dropped.duplicate;
        continue;
      }
      previous = point.position;
      if (layout.intensity != nullptr) {
        point.intensity =
            static_cast<float>(load_as(at + layout.intensity->offset, layout.intensity->datatype));
        if (!std::isfinite(point.intensity)) point.intensity = 0.0F;
      }
      if (layout.ring != nullptr) {
        const double ring = load_as(at + layout.ring->offset, layout.ring->datatype);
        if (ring < 0.0 || ring > 1023.0) {
          ++scan->dropped.out_of_range;
          continue;
        }
        point.ring = static_cast<std::uint16_t>(ring);
      } else if (layout.rows_are_rings) {
        point.ring = static_cast<std::uint16_t>(cloud.height - 1 - row);
      } else {
        const double elevation_deg = std::asin(point.position.z() / std::sqrt(range_sq)) * 180.0 / M_PI;
        const double beam =
            std::round((elevation_deg - sensor_.elevation_min_deg) / std::max(1e-6, beam_step));
        point.ring = static_cast<std::uint16_t>(std::clamp(beam, 0.0, sensor_.ring_count - 1.0));
      }
      if (layout.time != nullptr) {
        const double time = load_as(at + layout.time->offset, layout.time->datatype);
        if (!std::isfinite(time)) {
          ++scan->dropped.non_finite;
          continue;
        }
        times->push_back(time);
      }
      scan->points.push_back(point);
    }
  }
}

double PointCloudReader::seconds_per_unit(double span) {
  // The unit that makes the span of a sweep closest to the period of one revolution.
  if (seconds_per_unit_ != 0.0 || span <= 0.0) return seconds_per_unit_ != 0.0 ? seconds_per_unit_ : 1.0;
  double best = std::numeric_limits<double>::max();
  for (const double unit : {1.0, 1e-3, 1e-6, 1e-9}) {
    const double mismatch = std::abs(std::log(span * unit / sensor_.scan_period_s));
    if (mismatch >= best) continue;
    best = mismatch;
    seconds_per_unit_ = unit;
  }
  return seconds_per_unit_;
}

void PointCloudReader::set_times(const RawCloud& cloud, const std::vector<double>& times, bool is_integer,
                                 Scan* scan) {
  const auto [first, last] = std::minmax_element(times.begin(), times.end());
  const double unit = seconds_per_unit(*last - *first);
  const double span_s = (*last - *first) * unit;
  if (span_s > 5.0 * sensor_.scan_period_s) {
    reporter_->report(
        Severity::kWarning, "cloud_time_span",
        "the point times of a cloud span " + std::to_string(span_s) +
            " s, more than five revolutions: they are not used, check the driver and sensor.scan_period");
    set_times_by_azimuth(cloud, scan);
    return;
  }
  const double last_s = *last * unit;
  // A time of more than a day cannot be relative to the header.
  const bool is_absolute = std::abs(last_s) > 86400.0;
  if (is_absolute) {
    scan->stamp = is_integer && unit == 1e-9 ? static_cast<Stamp>(*last) : to_nanoseconds(last_s);
  } else if (*first * unit < -1e-4 || sensor_.stamp_at == "start") {
    // Negative times count back from the header stamp, whatever it was said to be.
    scan->stamp = add_seconds(cloud.stamp, last_s);
  } else {
    scan->stamp = cloud.stamp;
  }
  scan->stamp = add_seconds(scan->stamp, sensor_.lidar_time_offset_s);
  scan->duration_s = span_s;
  scan->has_time = span_s > 0.0;
  for (std::size_t i = 0; i < times.size(); ++i)
    scan->points[i].time_s = static_cast<float>((times[i] - *last) * unit);
}

void PointCloudReader::set_times_by_azimuth(const RawCloud& cloud, Scan* scan) {
  const double period = sensor_.scan_period_s;
  for (Point& point : scan->points) {
    const double turned = (M_PI - std::atan2(point.position.y(), point.position.x())) / (2.0 * M_PI);
    point.time_s = static_cast<float>(period * (turned - 1.0));
  }
  scan->stamp =
      add_seconds(cloud.stamp, (sensor_.stamp_at == "start" ? period : 0.0) + sensor_.lidar_time_offset_s);
  scan->duration_s = period;
  scan->has_time = true;
}

void PointCloudReader::report_layout(const Layout& layout, double seconds_per_unit) {
  if (reporter_->notices().count("cloud_layout") != 0) return;
  const auto name = [](const RawField* field, const std::string& otherwise) {
    return field != nullptr ? "'" + field->name + "'" : otherwise;
  };
  std::string time = "none needed (already deskewed)";
  if (sensor_.deskew != "already_done") {
    time = name(layout.time, "from the azimuth");
    if (layout.time != nullptr) time += " in units of " + std::to_string(seconds_per_unit * 1e9) + " ns";
  }
  reporter_->report(Severity::kInfo, "cloud_layout",
                    "lidar format: ring " +
                        name(layout.ring, layout.rows_are_rings ? "from the rows" : "from the elevation") +
                        ", time " + time + ", intensity " + name(layout.intensity, "absent"));
}

}  // namespace fdi_lio::scan
