#include "fdi_lio/simulation/sidecar_files.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {

namespace {

constexpr double kDegree = M_PI / 180.0;

std::ofstream open_for_writing(const std::string& path, std::ios::openmode mode = std::ios::out) {
  std::ofstream out(path, mode | std::ios::trunc);
  if (!out) throw Error("cannot write " + path + ": check the folder and its permissions");
  return out;
}

void finish(std::ofstream* out, const std::string& path) {
  out->close();
  if (!*out) throw Error("cannot write all of " + path + ": is the disk full?");
}

std::string list_of(const std::vector<double>& values, double scale) {
  std::string text = "[";
  for (std::size_t i = 0; i < values.size(); ++i) {
    char number[32];
    std::snprintf(number, sizeof(number), "%s%.6g", i > 0 ? ", " : "", scale * values[i]);
    text += number;
  }
  return text + "]";
}

std::string vector_text(const Eigen::Vector3d& v) { return list_of({v.x(), v.y(), v.z()}, 1.0); }

std::string matrix_text(const Eigen::Matrix3d& m) {
  return "[" + vector_text(m.row(0)) + ", " + vector_text(m.row(1)) + ", " + vector_text(m.row(2)) + "]";
}

std::string quaternion_text(const Eigen::Quaterniond& q) {
  char text[128];
  std::snprintf(text, sizeof(text), "[%.9g, %.9g, %.9g, %.9g]", q.x(), q.y(), q.z(), q.w());
  return text;
}

}  // namespace

TumWriter::TumWriter(const std::string& path) : path_(path), out_(open_for_writing(path)) {
  out_ << "# stamp[s] tx ty tz[m] qx qy qz qw: pose of the IMU in the map frame\n";
}

void TumWriter::add(Stamp stamp, const Eigen::Isometry3d& T_map_imu) {
  const Eigen::Quaterniond q(T_map_imu.linear());
  const Eigen::Vector3d& t = T_map_imu.translation();
  char line[256];
  std::snprintf(line, sizeof(line), "%lld.%09lld %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n",
                static_cast<long long>(stamp / 1000000000), static_cast<long long>(stamp % 1000000000), t.x(),
                t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  out_ << line;
}

void TumWriter::close() { finish(&out_, path_); }

LabelWriter::LabelWriter(const std::string& path)
    : path_(path), out_(open_for_writing(path, std::ios::binary)) {}

void LabelWriter::add(Stamp stamp, const std::vector<std::int16_t>& labels) {
  const auto count = static_cast<std::uint32_t>(labels.size());
  out_.write(reinterpret_cast<const char*>(&stamp), sizeof(stamp));
  out_.write(reinterpret_cast<const char*>(&count), sizeof(count));
  out_.write(reinterpret_cast<const char*>(labels.data()),
             static_cast<std::streamsize>(labels.size() * sizeof(std::int16_t)));
}

void LabelWriter::close() { finish(&out_, path_); }

void write_truth(const std::string& path, const Scenario& scenario, std::uint64_t seed,
                 std::optional<double> tunnel_begin_x_m, const LidarErrors& errors, const ImuAxes& axes,
                 const ImuReading& first, const ImuReading& last) {
  std::ofstream out = open_for_writing(path);
  out << "seed: " << seed << "\n";
  if (tunnel_begin_x_m) out << "tunnel_begin_x: " << *tunnel_begin_x_m << "\n";
  out << "T_imu_lidar_true:\n"
      << "  translation: " << vector_text(errors.T_imu_lidar.translation()) << "\n"
      << "  rotation: " << quaternion_text(Eigen::Quaterniond(errors.T_imu_lidar.linear())) << "\n"
      << "lidar_clock_ahead_s: " << errors.time_offset_s << "\n"
      << "gyro_bias_first: " << vector_text(first.true_gyro_bias) << "\n"
      << "gyro_bias_last: " << vector_text(last.true_gyro_bias) << "\n"
      << "accel_bias_first: " << vector_text(first.true_accel_bias) << "\n"
      << "accel_bias_last: " << vector_text(last.true_accel_bias) << "\n"
      << "gyro_axes: " << matrix_text(axes.gyro) << "\n"
      << "accel_axes: " << matrix_text(axes.accel) << "\n"
      << "beam_elevation_error_deg: " << list_of(errors.elevation_rad, 1.0 / kDegree) << "\n"
      << "beam_azimuth_error_deg: " << list_of(errors.azimuth_rad, 1.0 / kDegree) << "\n"
      << "beam_range_error_m: " << list_of(errors.range_m, 1.0) << "\n"
      << "beam_gain: " << list_of(errors.gain, 1.0) << "\n"
      << "scenario:\n";
  write_scenario(scenario, out, 2);
  finish(&out, path);
}

void write_system_config(const std::string& path, const Scenario& scenario, const LidarModel& model) {
  // A user would take the noise with a margin for vibration and for what a data sheet leaves out.
  constexpr double kNoiseMargin = 5.0;
  const auto by_elevation = [](const Beam& a, const Beam& b) { return a.elevation_rad < b.elevation_rad; };
  const auto [low, high] = std::minmax_element(model.beams.begin(), model.beams.end(), by_elevation);
  std::ofstream out = open_for_writing(path);
  out << "# Parameters of fdi_lio for this recording, written by simulate_bag. The mounting is the nominal "
         "one.\n"
      << "sensor:\n"
      << "  scan_period: " << model.period_s() << "\n"
      << "  ring_count: " << model.beams.size() << "\n"
      << "  elevation_min: " << low->elevation_rad / kDegree << "\n"
      << "  elevation_max: " << high->elevation_rad / kDegree << "\n"
      << "  min_range: 1.0\n"
      << "  max_range: " << model.max_range_m << "\n"
      << "  range_noise: " << std::max(model.range_noise_m, 1e-3) << "\n"
      << "  gyro_noise: " << kNoiseMargin * scenario.imu.gyro_noise << "\n"
      << "  accel_noise: " << kNoiseMargin * scenario.imu.accel_noise << "\n"
      << "  gyro_bias_walk: " << kNoiseMargin * scenario.imu.gyro_bias_walk << "\n"
      << "  accel_bias_walk: " << kNoiseMargin * scenario.imu.accel_bias_walk << "\n"
      << "  gravity: " << scenario.imu.gravity_mps2 << "\n"
      << "  T_imu_lidar:\n"
      << "    translation: " << vector_text(scenario.lidar.t_imu_lidar) << "\n"
      << "    rotation: " << quaternion_text(scenario.lidar.q_imu_lidar) << "\n";
  finish(&out, path);
}

}  // namespace fdi_lio::simulation
