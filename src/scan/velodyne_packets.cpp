#include "fdi_lio/scan/velodyne_packets.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "fdi_lio/scan/range_limits.hpp"

namespace fdi_lio::scan {

namespace {

constexpr int kBlocks = 12;
constexpr int kFirings = 2;
constexpr int kLasers = 16;
constexpr std::size_t kBlockBytes = 100;
constexpr std::size_t kReturnBytes = 3;
constexpr std::size_t kTimeOffset = 1200;
constexpr std::size_t kModeOffset = 1204;
constexpr std::size_t kProductOffset = 1205;
constexpr std::uint16_t kBlockFlag = 0xEEFF;
constexpr std::uint8_t kDualReturn = 0x39;
constexpr std::uint8_t kProductVlp16 = 0x22;

constexpr double kDistanceUnitM = 0.002;
constexpr double kAzimuthUnitRad = 0.01 * M_PI / 180.0;
constexpr int kAzimuthUnitsPerTurn = 36000;
/// A block turns 0.2 degrees at 10 Hz and 0.4 at 20 Hz; more than this is no turn but a jump.
constexpr int kMaxBlockTurnUnits = 200;
constexpr double kFiringPeriodS = 55.296e-6;
constexpr double kLaserPeriodS = 2.304e-6;
constexpr double kBlockPeriodS = kFirings * kFiringPeriodS;

constexpr std::int64_t kHourUs = 3600000000;
/// Packets of one message span at most so many revolutions, and at least this time each (half of that in dual
/// mode, so that lost precision does not matter), or their clock does not run.
constexpr double kMaxRevolutions = 5.0;
constexpr double kMinPacketS = 0.5 * 6 * kBlockPeriodS;

bool is_dual(const VelodynePacket& packet) { return packet.data[kModeOffset] == kDualReturn; }

/// The little-endian number at `at`, as the sensor and ROS write it.
template <typename T>
T load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof(value));
  return value;
}

struct Laser {
  double cos_elevation;
  double sin_elevation;
  double offset_m;  ///< upwards from the sensor's centre
  std::uint16_t ring;
};
using Lasers = std::array<Laser, kLasers>;

/// The lasers in the order of firing: -15, 1, -13, 3, ... -1, 15 degrees.
Lasers make_lasers() {
  constexpr double kOffsetsMm[kLasers] = {11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1,
                                          5.1,  -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2};
  Lasers lasers{};
  for (int l = 0; l < kLasers; ++l) {
    const int ring = l % 2 == 0 ? l / 2 : l / 2 + kLasers / 2;
    const double elevation = (2.0 * ring - 15.0) * M_PI / 180.0;
    lasers[l] = {std::cos(elevation), std::sin(elevation), 1e-3 * kOffsetsMm[l],
                 static_cast<std::uint16_t>(ring)};
  }
  return lasers;
}

struct Return {
  std::uint16_t distance;  ///< units; 0: nothing came back
  std::uint8_t reflectivity;
};

/// Two firing sequences: a block, or in dual mode a pair of blocks.
struct Block {
  const std::uint8_t* at = nullptr;
  const std::uint8_t* strongest = nullptr;  ///< the second block of a pair
  std::size_t packet = 0;
  double start_s = 0.0;  ///< time of its first firing
  int azimuth = 0;       ///< units
  double turn = 0.0;     ///< units until the next block
  bool is_good = false;
  bool knows_turn = false;

  Return shot(int f, int l) const {
    const auto read = [f, l](const std::uint8_t* block) {
      const std::uint8_t* bytes = block + 4 + static_cast<std::size_t>(f * kLasers + l) * kReturnBytes;
      return Return{load<std::uint16_t>(bytes), bytes[2]};
    };
    const Return last = read(at);
    if (strongest == nullptr) return last;
    // When the last return is the strongest one, the second block holds the second strongest.
    const Return other = read(strongest);
    const bool is_stronger = other.distance > 0 && other.reflectivity > last.reflectivity;
    return is_stronger || last.distance == 0 ? other : last;
  }
};

/// Blocks of all packets in their order: 12 a packet, or 6 pairs.
std::vector<Block> read_blocks(const std::vector<VelodynePacket>& packets,
                               const std::vector<double>& starts_s) {
  std::vector<Block> blocks;
  blocks.reserve(packets.size() * kBlocks);
  for (std::size_t i = 0; i < packets.size(); ++i) {
    const int step = is_dual(packets[i]) ? 2 : 1;
    for (int b = 0; b < kBlocks; b += step) {
      Block block;
      block.at = packets[i].data + static_cast<std::size_t>(b) * kBlockBytes;
      if (step == 2) block.strongest = block.at + kBlockBytes;
      block.packet = i;
      block.start_s = starts_s[i] + kBlockPeriodS * (b / step);
      block.azimuth = load<std::uint16_t>(block.at + 2);
      block.is_good = load<std::uint16_t>(block.at) == kBlockFlag && block.azimuth < kAzimuthUnitsPerTurn;
      blocks.push_back(block);
    }
  }
  return blocks;
}

double median(std::vector<int> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

/// How far the head turns in each block. The last block of a packet turns like the one before, because the
/// next packet may be lost; where a neighbour is bad or jumps, the median of the scan is taken.
void set_turns(std::vector<Block>* blocks) {
  const auto is_last = [blocks](std::size_t i) {
    return i + 1 == blocks->size() || (*blocks)[i + 1].packet != (*blocks)[i].packet;
  };
  std::vector<int> known;
  for (std::size_t i = 0; i < blocks->size(); ++i) {
    if (is_last(i)) continue;
    Block& block = (*blocks)[i];
    const Block& next = (*blocks)[i + 1];
    const int turn = (next.azimuth - block.azimuth + kAzimuthUnitsPerTurn) % kAzimuthUnitsPerTurn;
    if (!block.is_good || !next.is_good || turn > kMaxBlockTurnUnits) continue;
    block.turn = turn;
    block.knows_turn = true;
    known.push_back(turn);
  }
  const double usual = median(std::move(known));
  for (std::size_t i = 0; i < blocks->size(); ++i) {
    Block& block = (*blocks)[i];
    if (!block.knows_turn) block.turn = is_last(i) ? (*blocks)[i - 1].turn : usual;
  }
}

/// Where laser `l` of firing sequence `f` hit, by the manual's equations; lidar frame, metres.
Eigen::Vector3f locate(const Block& block, int f, int l, const Laser& laser, double distance_m) {
  const double share = (f * kFiringPeriodS + l * kLaserPeriodS) / kBlockPeriodS;
  const double azimuth = kAzimuthUnitRad * (block.azimuth + block.turn * share);
  const double horizontal = distance_m * laser.cos_elevation;
  return Eigen::Vector3d(horizontal * std::cos(azimuth), -horizontal * std::sin(azimuth),
                         distance_m * laser.sin_elevation + laser.offset_m)
      .cast<float>();
}

/// Adds the points of a good block to `scan` and their times to `times_s`.
void add_points(const Block& block, const Lasers& lasers, const RangeLimits& limits,
                std::vector<double>* times_s, Scan* scan) {
  for (int f = 0; f < kFirings; ++f) {
    for (int l = 0; l < kLasers; ++l) {
      const Return shot = block.shot(f, l);
      if (shot.distance == 0) {
        ++scan->dropped.zero;
        continue;
      }
      Point point;
      point.position = locate(block, f, l, lasers[l], kDistanceUnitM * shot.distance);
      if (!limits.accept(point.position, &scan->dropped)) continue;
      point.intensity = shot.reflectivity;
      point.ring = lasers[l].ring;
      times_s->push_back(block.start_s + f * kFiringPeriodS + l * kLaserPeriodS);
      scan->points.push_back(point);
    }
  }
}

/// Seconds from the first of `times` (nanoseconds); empty when they cannot be the times of the packets of one
/// message, because the clock stands still or jumps.
std::vector<double> offsets_of_running_clock(const std::vector<std::int64_t>& times, double period_s) {
  std::vector<double> offsets;
  offsets.reserve(times.size());
  for (const std::int64_t time : times) offsets.push_back(seconds_between(times.front(), time));
  const auto [first, last] = std::minmax_element(offsets.begin(), offsets.end());
  const double span = *last - *first;
  const bool is_running =
      span >= kMinPacketS * static_cast<double>(times.size() - 1) && span <= kMaxRevolutions * period_s;
  if (!is_running) offsets.clear();
  return offsets;
}

}  // namespace

std::optional<std::vector<VelodynePacket>> split_velodyne_scan(const std::uint8_t* message,
                                                               std::size_t size) {
  constexpr std::size_t kHeaderBytes = 16;  // sequence number, time, length of the frame's name
  constexpr std::size_t kStampedBytes = 8 + kVelodynePacketBytes;
  if (size < kHeaderBytes) return std::nullopt;
  const std::size_t count_at = kHeaderBytes + load<std::uint32_t>(message + kHeaderBytes - 4);
  if (size < count_at + 4) return std::nullopt;
  const std::size_t count = load<std::uint32_t>(message + count_at);
  if (size - count_at - 4 != count * kStampedBytes) return std::nullopt;
  std::vector<VelodynePacket> packets(count);
  const std::uint8_t* at = message + count_at + 4;
  for (VelodynePacket& packet : packets) {
    packet.stamp = load<std::uint32_t>(at) * Stamp{1000000000} + load<std::uint32_t>(at + 4);
    packet.data = at + 8;
    at += kStampedBytes;
  }
  return packets;
}

VelodynePacketReader::VelodynePacketReader(const SensorConfig& sensor, Reporter* reporter)
    : sensor_(sensor), reporter_(reporter) {}

std::optional<Scan> VelodynePacketReader::read(const std::vector<VelodynePacket>& packets) {
  if (packets.empty()) {
    reporter_->report(Severity::kWarning, "cloud_empty", "a scan was dropped: its message has no packets");
    return std::nullopt;
  }
  if (!is_vlp16(packets)) return std::nullopt;
  const std::optional<PacketTimes> times = find_times(packets);
  if (!times) return std::nullopt;
  std::vector<Block> blocks = read_blocks(packets, times->starts_s);
  set_turns(&blocks);

  Scan scan;
  std::vector<double> times_s;
  const Lasers lasers = make_lasers();
  const RangeLimits limits(sensor_);
  std::size_t bad_blocks = 0;
  for (const Block& block : blocks) {
    if (block.is_good) {
      add_points(block, lasers, limits, &times_s, &scan);
    } else {
      ++bad_blocks;
    }
  }
  report_blocks(bad_blocks, blocks.size(), scan);
  if (scan.points.empty()) return std::nullopt;
  const auto [first, last] = std::minmax_element(times_s.begin(), times_s.end());
  scan.stamp = add_seconds(times->origin, *last + sensor_.lidar_time_offset_s);
  scan.duration_s = *last - *first;
  scan.has_time = true;
  scan.has_intensity = true;
  scan.ring_count = static_cast<std::uint16_t>(std::max(sensor_.ring_count, kLasers));
  for (std::size_t i = 0; i < scan.points.size(); ++i)
    scan.points[i].time_s = static_cast<float>(times_s[i] - *last);
  report_format(is_dual(packets.front()), *times);
  return scan;
}

bool VelodynePacketReader::is_vlp16(const std::vector<VelodynePacket>& packets) {
  for (const VelodynePacket& packet : packets) {
    const std::uint8_t product = packet.data[kProductOffset];
    if (product == kProductVlp16 || product == 0) continue;  // some recorders do not fill the byte
    reporter_->report(Severity::kError, "packet_product",
                      "the packets come from a Velodyne with product code " + std::to_string(product) +
                          ", only those of the VLP-16 (34) can be decoded: record the clouds of its driver");
    return false;
  }
  return true;
}

std::optional<VelodynePacketReader::PacketTimes> VelodynePacketReader::find_times(
    const std::vector<VelodynePacket>& packets) {
  std::vector<std::int64_t> by_sensor;
  std::vector<std::int64_t> by_stamp;
  const std::int64_t first_us = load<std::uint32_t>(packets.front().data + kTimeOffset);
  for (const VelodynePacket& packet : packets) {
    // The hour may end within a scan, and a packet may arrive before an earlier one.
    const std::int64_t time_us = load<std::uint32_t>(packet.data + kTimeOffset);
    std::int64_t since_first_us = (time_us - first_us + kHourUs) % kHourUs;
    if (since_first_us > kHourUs / 2) since_first_us -= kHourUs;
    by_sensor.push_back(1000 * since_first_us);
    by_stamp.push_back(packet.stamp);
  }
  PacketTimes times;
  times.starts_s = offsets_of_running_clock(by_sensor, sensor_.scan_period_s);
  times.has_sensor_clock = !times.starts_s.empty();
  times.origin = by_stamp.front();
  if (times.has_sensor_clock) {
    for (std::size_t i = 0; i < packets.size(); ++i)
      times.origin = std::min(times.origin, by_stamp[i] - by_sensor[i]);
    return times;
  }
  times.starts_s = offsets_of_running_clock(by_stamp, sensor_.scan_period_s);
  if (!times.starts_s.empty()) return times;
  reporter_->report(Severity::kWarning, "packet_time",
                    "a scan was dropped: neither the clock of its packets nor their stamps run (or they span "
                    "more than five times sensor.scan_period)");
  return std::nullopt;
}

void VelodynePacketReader::report_blocks(std::size_t bad, std::size_t all, const Scan& scan) {
  if (bad > 0) {
    reporter_->report(Severity::kWarning, "packet_blocks",
                      std::to_string(bad) + " of " + std::to_string(all) +
                          " blocks of a scan were dropped: wrong flag, or an azimuth beyond 360 degrees");
  }
  if (scan.points.empty()) {
    reporter_->report(Severity::kWarning, "cloud_useless",
                      "a scan was dropped: none of its shots can be used (" +
                          std::to_string(scan.dropped.zero) + " without return, " +
                          std::to_string(scan.dropped.out_of_range) +
                          " beyond sensor.min_range or sensor.max_range)");
  }
}

void VelodynePacketReader::report_format(bool is_dual, const PacketTimes& times) {
  if (reporter_->has("cloud_layout")) return;
  reporter_->report(
      Severity::kInfo, "cloud_layout",
      std::string("lidar format: VLP-16 packets with ") +
          (is_dual ? "two returns a shot, of which the stronger is kept" : "one return a shot") +
          ", time from the " + (times.has_sensor_clock ? "sensor's clock" : "stamps of the packets"));
  if (sensor_.deskew == "already_done") {
    reporter_->report(
        Severity::kWarning, "packet_deskew",
        "sensor.deskew is already_done, but packets are never motion-compensated: they will be");
  }
}

}  // namespace fdi_lio::scan
