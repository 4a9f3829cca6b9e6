#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fdi_lio/scan/velodyne_packets.hpp"

namespace fdi_lio::scan {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr Stamp kStamp = 1700000000123456789;
constexpr double kFiringS = 55.296e-6;
constexpr double kLaserS = 2.304e-6;
constexpr double kBlockS = 2.0 * kFiringS;
constexpr Stamp kPacketNs = 1327104;
constexpr double kElevationDeg[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
constexpr double kOffsetMm[16] = {11.2, -0.7, 9.7, -2.2, 8.1, -3.7, 6.6, -5.1,
                                  5.1,  -6.6, 3.7, -8.1, 2.2, -9.7, 0.7, -11.2};

using Bytes = std::array<std::uint8_t, kVelodynePacketBytes>;
struct Shot {
  std::uint16_t distance;
  std::uint8_t reflectivity;
};
/// What laser l of firing f in block b measured.
using Scene = std::function<Shot(int b, int f, int l)>;

template <typename T>
void put(T value, std::size_t at, Bytes* bytes) {
  std::memcpy(bytes->data() + at, &value, sizeof(value));
}

/// A packet byte by byte; blocks (in dual mode pairs of them) are `turn` hundredths of a degree apart.
Bytes make_packet(int azimuth, int turn, std::uint32_t time_us, const Scene& scene,
                  std::uint8_t mode = 0x37) {
  Bytes bytes{};
  for (int b = 0; b < 12; ++b) {
    const std::size_t block = 100 * static_cast<std::size_t>(b);
    put<std::uint16_t>(0xEEFF, block, &bytes);
    const int step = mode == 0x39 ? b / 2 : b;
    put(static_cast<std::uint16_t>((azimuth + step * turn) % 36000), block + 2, &bytes);
    for (int k = 0; k < 32; ++k) {
      const Shot shot = scene(b, k / 16, k % 16);
      put(shot.distance, block + 4 + 3 * static_cast<std::size_t>(k), &bytes);
      put(shot.reflectivity, block + 6 + 3 * static_cast<std::size_t>(k), &bytes);
    }
  }
  put(time_us, 1200, &bytes);
  put(mode, 1204, &bytes);
  put<std::uint8_t>(0x22, 1205, &bytes);
  return bytes;
}

Scene only(int block, int firing, int laser) {
  return [=](int b, int f, int l) {
    return b == block && f == firing && l == laser ? Shot{2500, 77} : Shot{0, 0};
  };
}

Shot wall(int /*b*/, int /*f*/, int l) {
  return {static_cast<std::uint16_t>(std::lround(8.0 / std::cos(kElevationDeg[l] * M_PI / 180.0) / 0.002)),
          9};
}

class Packets : public testing::Test {
 protected:
  Packets() { sensor_.ring_count = 16; }

  std::optional<Scan> read(const std::vector<VelodynePacket>& packets) {
    return VelodynePacketReader(sensor_, &reporter_).read(packets);
  }

  /// A whole turn at 10 Hz; the sensor's clock is at `time_us` in the first packet.
  void make_turn(std::uint32_t time_us) {
    bytes_.resize(76);
    packets_.clear();
    for (int i = 0; i < 76; ++i) {
      const auto us = static_cast<std::uint32_t>((time_us + std::lround(1327.104 * i)) % 3600000000L);
      bytes_[i] = make_packet(i * 12 * 40 % 36000, 40, us, wall);
      packets_.push_back({kStamp + i * kPacketNs, bytes_[i].data()});
    }
  }

  std::string warnings() const {
    std::string text;
    for (const auto& entry : reporter_.notices()) {
      if (entry.second.severity != Severity::kInfo) text += entry.second.text + "\n";
    }
    return text;
  }

  SensorConfig sensor_;
  Reporter reporter_;
  std::vector<Bytes> bytes_;
  std::vector<VelodynePacket> packets_;
};

TEST_F(Packets, EachShotIsWhereAndWhenTheManualSays) {
  for (const auto& [b, f, l] :
       {std::array{0, 0, 0}, {0, 0, 15}, {0, 1, 0}, {3, 1, 7}, {11, 0, 4}, {11, 1, 15}}) {
    const Bytes bytes = make_packet(3000, 20, 5, only(b, f, l));
    const auto scan = read({{kStamp, bytes.data()}});
    ASSERT_TRUE(scan);
    ASSERT_EQ(scan->points.size(), 1U);
    EXPECT_EQ(scan->dropped.zero, 12U * 2 * 16 - 1);
    const double in_block_s = f * kFiringS + l * kLaserS;
    const double azimuth = (30.0 + 0.2 * b + 0.2 * in_block_s / kBlockS) * M_PI / 180.0;
    const double elevation = kElevationDeg[l] * M_PI / 180.0;
    const Eigen::Vector3d expected(5.0 * std::cos(elevation) * std::cos(azimuth),
                                   -5.0 * std::cos(elevation) * std::sin(azimuth),
                                   5.0 * std::sin(elevation) + 1e-3 * kOffsetMm[l]);
    const Point& point = scan->points.front();
    EXPECT_LT((point.position.cast<double>() - expected).norm(), 1e-6);
    EXPECT_EQ(point.ring, (kElevationDeg[l] + 15) / 2);
    EXPECT_EQ(point.intensity, 77.0F);
    EXPECT_NEAR(seconds_between(kStamp, scan->stamp), b * kBlockS + in_block_s, 1e-9);
    EXPECT_EQ(point.time_s, 0.0F);
  }
}

TEST_F(Packets, AzimuthIsInterpolatedAcrossNorth) {
  const Bytes bytes = make_packet(35990, 20, 0, only(0, 1, 0));
  const Eigen::Vector3f p = read({{kStamp, bytes.data()}})->points.front().position;
  EXPECT_NEAR(std::atan2(-p.y(), p.x()), 0.0, 1e-6);
}

TEST_F(Packets, AWallAllAroundComesBack) {
  make_turn(1000000);
  const auto scan = read(packets_);
  ASSERT_TRUE(scan);
  EXPECT_THAT(warnings(), IsEmpty());
  ASSERT_EQ(scan->points.size(), 76U * 384);
  EXPECT_TRUE(scan->has_time);
  EXPECT_TRUE(scan->has_intensity);
  EXPECT_EQ(scan->ring_count, 16);
  EXPECT_NEAR(scan->duration_s, 76 * 12 * kBlockS - kFiringS + 15 * kLaserS, 1e-6);
  std::array<int, 16> of_ring{};
  float before = -1.0F;
  for (const Point& point : scan->points) {
    EXPECT_NEAR(point.position.head<2>().norm(), 8.0, 0.0011);
    EXPECT_GE(point.time_s, before);
    before = point.time_s;
    ++of_ring[point.ring];
  }
  EXPECT_EQ(before, 0.0F);
  for (const int count : of_ring) EXPECT_EQ(count, 76 * 24);
}

TEST_F(Packets, TimesComeFromTheSensorsClockAndTheEarliestArrival) {
  make_turn(1000000);
  // The network delays every packet but the tenth.
  for (std::size_t i = 0; i < packets_.size(); ++i) packets_[i].stamp += i == 10 ? 0 : 1000000 * (1 + i % 3);
  const auto scan = read(packets_);
  ASSERT_TRUE(scan);
  EXPECT_NEAR(seconds_between(kStamp, scan->stamp),
              75 * 1e-9 * kPacketNs + 11 * kBlockS + kFiringS + 15 * kLaserS, 2e-6);
  EXPECT_NEAR(scan->points[384].time_s - scan->points[0].time_s, 1e-9 * kPacketNs, 1e-6);
  EXPECT_THAT(reporter_.notices().at("cloud_layout").text, HasSubstr("sensor's clock"));
}

TEST_F(Packets, TheHourMayEndWithinAScan) {
  make_turn(1000000);
  const auto expected = read(packets_);
  make_turn(3599950000U);
  const auto scan = read(packets_);
  ASSERT_TRUE(scan && expected);
  EXPECT_NEAR(seconds_between(expected->stamp, scan->stamp), 0.0, 2e-6);
  EXPECT_NEAR(scan->duration_s, expected->duration_s, 2e-6);
}

TEST_F(Packets, AClockThatStandsStillLeavesTheStamps) {
  make_turn(1000000);
  for (Bytes& bytes : bytes_) put<std::uint32_t>(123456, 1200, &bytes);
  packets_[1].stamp += 500000;
  const auto scan = read(packets_);
  ASSERT_TRUE(scan);
  EXPECT_NEAR(scan->points[384].time_s - scan->points[0].time_s, 1e-9 * (kPacketNs + 500000), 1e-7);
  EXPECT_THAT(reporter_.notices().at("cloud_layout").text, HasSubstr("stamps of the packets"));
}

TEST_F(Packets, WithoutAnyRunningClockTheScanIsDropped) {
  make_turn(1000000);
  for (Bytes& bytes : bytes_) put<std::uint32_t>(123456, 1200, &bytes);
  for (VelodynePacket& packet : packets_) packet.stamp = kStamp;
  EXPECT_FALSE(read(packets_));
  EXPECT_THAT(warnings(), HasSubstr("neither the clock of its packets nor their stamps run"));
}

TEST_F(Packets, PacketsInTheWrongOrderGiveTheSamePoints) {
  make_turn(1000000);
  const auto expected = read(packets_);
  std::swap(packets_[20], packets_[21]);
  const auto scan = read(packets_);
  ASSERT_TRUE(scan && expected);
  EXPECT_EQ(scan->stamp, expected->stamp);
  EXPECT_EQ(scan->points[21 * 384].position, expected->points[20 * 384].position);
  EXPECT_FLOAT_EQ(scan->points[21 * 384].time_s, expected->points[20 * 384].time_s);
}

TEST_F(Packets, DualReturnsKeepTheStrongerOne) {
  const auto scene = [](int b, int /*f*/, int l) -> Shot {
    const bool is_last = b % 2 == 0;
    if (l == 0) return is_last ? Shot{4000, 10} : Shot{2000, 90};  // last is the weaker
    if (l == 1) return is_last ? Shot{4000, 90} : Shot{2000, 10};  // last is the strongest
    if (l == 2) return {3000, 50};                                 // one return, in both blocks
    if (l == 3) return is_last ? Shot{0, 0} : Shot{1000, 5};
    if (l == 4) return is_last ? Shot{1000, 5} : Shot{0, 90};
    return {0, 0};
  };
  const Bytes bytes = make_packet(0, 20, 0, scene, 0x39);
  const auto scan = read({{kStamp, bytes.data()}});
  ASSERT_TRUE(scan);
  const double expected_m[16] = {4.0, 6.0, 2.0, 0, 0, 0, 0, 0, 8.0, 2.0};  // by ring
  for (const Point& point : scan->points)
    EXPECT_NEAR(point.position.norm(), expected_m[point.ring], 0.012) << point.ring;
  // Six pairs, two firings each.
  EXPECT_EQ(scan->points.size(), 5U * 12);
  // Six pairs in time, not twelve blocks.
  EXPECT_NEAR(seconds_between(kStamp, scan->stamp), 5 * kBlockS + kFiringS + 4 * kLaserS, 1e-9);
  EXPECT_THAT(reporter_.notices().at("cloud_layout").text, HasSubstr("two returns"));
}

TEST_F(Packets, BadBlocksAreDroppedAndTheirNeighboursTurnAsUsual) {
  Bytes bytes = make_packet(0, 20, 0, [](int, int, int) { return Shot{2500, 1}; });
  put<std::uint16_t>(0, 100, &bytes);
  put<std::uint16_t>(0xFFFF, 202, &bytes);
  const auto scan = read({{kStamp, bytes.data()}});
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->points.size(), 10U * 32);
  EXPECT_THAT(warnings(), HasSubstr("2 of 12 blocks"));
  const Eigen::Vector3f p = scan->points[31].position;
  EXPECT_NEAR(std::atan2(-p.y(), p.x()) * 180.0 / M_PI, 0.2 * (kFiringS + 15 * kLaserS) / kBlockS, 1e-4);
}

TEST_F(Packets, OtherSensorsAreRefused) {
  Bytes bytes = make_packet(0, 20, 0, wall);
  bytes[1205] = 0x28;
  EXPECT_FALSE(read({{kStamp, bytes.data()}}));
  EXPECT_THAT(warnings(), HasSubstr("product code 40"));
  bytes[1205] = 0;
  EXPECT_TRUE(read({{kStamp, bytes.data()}}));
}

TEST_F(Packets, NothingToUseIsNamed) {
  EXPECT_FALSE(read({}));
  EXPECT_THAT(warnings(), HasSubstr("no packets"));
  const Bytes bytes = make_packet(0, 20, 0, [](int, int, int) { return Shot{0, 0}; });
  EXPECT_FALSE(read({{kStamp, bytes.data()}}));
  EXPECT_THAT(warnings(), HasSubstr("384 without return"));
}

TEST_F(Packets, RangeLimitsAndTimeOffsetHold) {
  sensor_.max_range_m = 6.0;
  sensor_.lidar_time_offset_s = -0.5;
  const auto scene = [](int b, int f, int l) -> Shot {
    if (b > 0 || f > 0 || l > 1) return {0, 0};
    return l == 0 ? Shot{2500, 1} : Shot{3500, 1};
  };
  const Bytes bytes = make_packet(0, 20, 0, scene);
  const auto scan = read({{kStamp, bytes.data()}});
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->points.size(), 1U);
  EXPECT_EQ(scan->dropped.out_of_range, 1U);
  EXPECT_EQ(scan->stamp, kStamp - 500000000);
}

// --- the message around the packets ---

/// A velodyne_msgs/VelodyneScan as ROS serialises it.
std::vector<std::uint8_t> serialise(const std::vector<VelodynePacket>& packets) {
  std::vector<std::uint8_t> out;
  const auto number = [&out](std::uint32_t value) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
    out.insert(out.end(), bytes, bytes + 4);
  };
  for (const std::uint32_t value : {7U, 1U, 2U, 8U}) number(value);
  for (const char c : std::string("velodyne")) out.push_back(static_cast<std::uint8_t>(c));
  number(static_cast<std::uint32_t>(packets.size()));
  for (const VelodynePacket& packet : packets) {
    number(static_cast<std::uint32_t>(packet.stamp / 1000000000));
    number(static_cast<std::uint32_t>(packet.stamp % 1000000000));
    out.insert(out.end(), packet.data, packet.data + kVelodynePacketBytes);
  }
  return out;
}

TEST_F(Packets, AMessageIsSplitIntoItsPackets) {
  make_turn(0);
  const std::vector<std::uint8_t> message = serialise(packets_);
  const auto split = split_velodyne_scan(message.data(), message.size());
  ASSERT_TRUE(split);
  ASSERT_EQ(split->size(), 76U);
  for (std::size_t i = 0; i < 76; ++i) {
    EXPECT_EQ((*split)[i].stamp, packets_[i].stamp);
    EXPECT_EQ(std::memcmp((*split)[i].data, bytes_[i].data(), kVelodynePacketBytes), 0);
  }
}

TEST_F(Packets, AMessageOfAWrongSizeIsRefused) {
  make_turn(0);
  packets_.resize(2);
  std::vector<std::uint8_t> message = serialise(packets_);
  for (const std::size_t size : {std::size_t{0}, std::size_t{15}, std::size_t{20}, message.size() - 1})
    EXPECT_FALSE(split_velodyne_scan(message.data(), size)) << size;
  message.push_back(0);
  EXPECT_FALSE(split_velodyne_scan(message.data(), message.size()));
  message.pop_back();
  message[12] = 0xFF;  // length of the frame's name
  message[15] = 0xFF;
  EXPECT_FALSE(split_velodyne_scan(message.data(), message.size()));
}

}  // namespace
}  // namespace fdi_lio::scan
