#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::scan {

constexpr std::size_t kVelodynePacketBytes = 1206;

/// One data packet as the driver recorded it; `data` are 1206 bytes that must outlive it.
struct VelodynePacket {
  Stamp stamp = 0;  ///< when it was received, which the driver takes for the time of its first firing
  const std::uint8_t* data = nullptr;
};

/// The packets of a serialised velodyne_msgs/VelodyneScan (Header, then packets of {time, uint8[1206]}), as
/// views into `message`. Nothing when the sizes in the message do not fit its `size` bytes.
std::optional<std::vector<VelodynePacket>> split_velodyne_scan(const std::uint8_t* message, std::size_t size);

/// Decodes data packets of a Velodyne VLP-16 into scans. All numbers and equations are those of the "VLP-16
/// User Manual", 63-9243, chapter 9.
///
/// A packet has 12 blocks {flag FF EE, azimuth alpha in 0.01 degree, 2 firing sequences of 16 lasers, each
/// {distance in 2 mm, reflectivity}}, then the time of its first firing in microseconds past the hour, the
/// return mode and the product. For block b, firing sequence f and laser l:
///   t     = t_packet + b 110.592 us + f 55.296 us + l 2.304 us
///   alpha = alpha_b + (alpha_b+1 - alpha_b) (f 55.296 + l 2.304) / 110.592
///   x = r cos(omega_l) cos(alpha), y = -r cos(omega_l) sin(alpha), z = r sin(omega_l) + v_l
/// with the elevation omega_l and the vertical offset v_l of laser l. The axes are those of the ROS driver: x
/// where the azimuth is zero, y to the left, z up. Ring 0 is the lowest beam. In dual mode two blocks share
/// an azimuth and a time, the last and the strongest return; of each pair the one with the higher
/// reflectivity is kept.
///
/// Times within a scan come from the packets' own clock where it runs, which does not know the delays of the
/// network, and are tied to the stamps by the packet with the smallest delay; otherwise from the stamps.
class VelodynePacketReader {
 public:
  VelodynePacketReader(const SensorConfig& sensor, Reporter* reporter);

  /// The scan of one message, in the lidar frame, stamped with its last point; nothing (and a report) when
  /// there is no usable point or the packets are another sensor's. Shots without return count as `zero`;
  /// points out of range are dropped and counted too.
  std::optional<Scan> read(const std::vector<VelodynePacket>& packets);

 private:
  /// When the packets of one message were fired.
  struct PacketTimes {
    Stamp origin = 0;
    std::vector<double> starts_s;  ///< first firing of each packet, since `origin`
    bool has_sensor_clock = false;
  };

  bool is_vlp16(const std::vector<VelodynePacket>& packets);
  std::optional<PacketTimes> find_times(const std::vector<VelodynePacket>& packets);
  void report_blocks(std::size_t bad, std::size_t all, const Scan& scan);
  void report_format(bool is_dual, const PacketTimes& times);

  SensorConfig sensor_;
  Reporter* reporter_;
};

}  // namespace fdi_lio::scan
