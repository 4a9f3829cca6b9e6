#include "fdi_lio/simulation/cloud_encoding.hpp"

#include <cstring>

#include <gtest/gtest.h>

namespace fdi_lio::simulation {
namespace {

/// Two columns of two beams; the return at column 1, ring 0 is missing.
LidarScan small_scan() {
  LidarScan scan;
  scan.columns = 2;
  scan.beams = 2;
  scan.returns.resize(4);
  for (std::size_t i = 0; i < 4; ++i) {
    LidarReturn& r = scan.returns[i];
    r.valid = i != 2;
    if (!r.valid) continue;
    r.p_lidar = Eigen::Vector3f(1.0f + static_cast<float>(i), 2.0f, 3.0f);
    r.range_m = 4.125f;
    r.intensity = 10.0f * static_cast<float>(i + 1);
    r.reflectivity = static_cast<std::uint16_t>(20 + i);
    r.ambient = static_cast<std::uint16_t>(300 + i);
    r.label = static_cast<std::int16_t>(i);
  }
  return scan;
}

template <typename T>
T at(const EncodedCloud& cloud, std::size_t point, std::size_t offset) {
  T value;
  std::memcpy(&value, cloud.data.data() + point * cloud.point_step + offset, sizeof(T));
  return value;
}

TEST(CloudEncoding, VelodyneLayoutIsTheDrivers) {
  const EncodedCloud cloud = encode_cloud(small_scan(), CloudLayout::kVelodyne, false);
  ASSERT_EQ(cloud.point_step, 22u);
  ASSERT_EQ(cloud.height, 1u);
  ASSERT_EQ(cloud.width, 3u);
  ASSERT_EQ(cloud.data.size(), 66u);
  const std::vector<std::pair<std::string, std::uint32_t>> expected{
      {"x", 0}, {"y", 4}, {"z", 8}, {"intensity", 12}, {"ring", 16}, {"time", 18}};
  ASSERT_EQ(cloud.fields.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(cloud.fields[i].name, expected[i].first);
    EXPECT_EQ(cloud.fields[i].offset, expected[i].second);
    EXPECT_EQ(cloud.fields[i].datatype, expected[i].first == "ring" ? 4 : 7);
  }
  EXPECT_EQ(at<float>(cloud, 2, 0), 4.0f);
  EXPECT_EQ(at<float>(cloud, 2, 12), 40.0f);
  EXPECT_EQ(at<std::uint16_t>(cloud, 2, 16), 1);
  EXPECT_FLOAT_EQ(at<float>(cloud, 2, 18), 0.05f);
  EXPECT_EQ(cloud.labels, (std::vector<std::int16_t>{0, 1, 3}));
}

TEST(CloudEncoding, VelodyneStampAtEndCountsBack) {
  const EncodedCloud cloud = encode_cloud(small_scan(), CloudLayout::kVelodyne, true);
  EXPECT_FLOAT_EQ(at<float>(cloud, 0, 18), -0.05f);
  EXPECT_FLOAT_EQ(at<float>(cloud, 2, 18), 0.0f);
}

TEST(CloudEncoding, OusterLayoutIsTheDrivers) {
  const EncodedCloud cloud = encode_cloud(small_scan(), CloudLayout::kOuster, false);
  ASSERT_EQ(cloud.point_step, 48u);
  ASSERT_EQ(cloud.height, 2u);
  ASSERT_EQ(cloud.width, 2u);
  const std::vector<std::pair<std::string, std::uint32_t>> expected{
      {"x", 0},     {"y", 4},        {"z", 8},     {"intensity", 16}, {"t", 20}, {"reflectivity", 24},
      {"ring", 26}, {"ambient", 28}, {"range", 32}};
  const std::vector<int> types{7, 7, 7, 7, 6, 4, 4, 4, 6};
  ASSERT_EQ(cloud.fields.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(cloud.fields[i].name, expected[i].first);
    EXPECT_EQ(cloud.fields[i].offset, expected[i].second);
    EXPECT_EQ(cloud.fields[i].datatype, types[i]);
  }
  // Row-major by ring: point 3 is ring 1 of column 1.
  EXPECT_EQ(at<float>(cloud, 3, 0), 4.0f);
  EXPECT_EQ(at<std::uint32_t>(cloud, 3, 20), 50000000u);
  EXPECT_EQ(at<std::uint16_t>(cloud, 3, 24), 23);
  EXPECT_EQ(at<std::uint16_t>(cloud, 3, 26), 1);
  EXPECT_EQ(at<std::uint16_t>(cloud, 3, 28), 303);
  EXPECT_EQ(at<std::uint32_t>(cloud, 3, 32), 4125u);
  // The missing point is zero but keeps its ring and time.
  EXPECT_EQ(at<float>(cloud, 1, 0), 0.0f);
  EXPECT_EQ(at<std::uint32_t>(cloud, 1, 32), 0u);
  EXPECT_EQ(cloud.labels, (std::vector<std::int16_t>{0, 0, 1, 3}));
}

}  // namespace
}  // namespace fdi_lio::simulation
