#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/mapping/cloud_file.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {
namespace {

TEST(MapBuilder, WritesOneMeanPointAVoxel) {
  MapBuilder builder(1.0);
  Point a;
  a.position = Eigen::Vector3f(0.2F, 0.2F, 0.2F);
  a.intensity = 10.0F;
  Point b = a;
  b.position.x() = 0.6F;
  b.intensity = 30.0F;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation().x() = 5.0;
  builder.add({a, b}, T);
  const std::string path =
      (std::filesystem::temp_directory_path() / ("fdi_lio_map_" + std::to_string(getpid()) + ".pcd"))
          .string();
  write_cloud(path, builder.points(), CloudFormat::kPcd);
  std::ifstream in(path, std::ios::binary);
  std::string line;
  while (std::getline(in, line) && line != "DATA binary") {
  }
  float data[4] = {};
  in.read(reinterpret_cast<char*>(data), sizeof(data));
  EXPECT_EQ(builder.size(), 1U);
  EXPECT_NEAR(data[0], 5.4F, 1e-5F);
  EXPECT_NEAR(data[1], 0.2F, 1e-5F);
  EXPECT_NEAR(data[3], 20.0F, 1e-5F);
  std::filesystem::remove(path);
}

TEST(CloudFile, PlyHasTheSamePointsAsPcd) {
  Point point;
  point.position = Eigen::Vector3f(1.0F, -2.0F, 3.5F);
  point.intensity = 7.0F;
  const std::string path =
      (std::filesystem::temp_directory_path() / ("fdi_lio_map_" + std::to_string(getpid()) + ".ply"))
          .string();
  write_cloud(path, {Point(), point}, to_cloud_format("ply"));
  std::ifstream in(path, std::ios::binary);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "ply");
  std::string element;
  while (std::getline(in, line) && line != "end_header") {
    if (line.rfind("element", 0) == 0) element = line;
  }
  EXPECT_EQ(element, "element vertex 2");
  float data[8] = {};
  in.read(reinterpret_cast<char*>(data), sizeof(data));
  EXPECT_EQ(data[5], -2.0F);
  EXPECT_EQ(data[7], 7.0F);
  EXPECT_EQ(in.peek(), std::ifstream::traits_type::eof());
  std::filesystem::remove(path);
  EXPECT_THROW(to_cloud_format("las"), Error);
}

TEST(MapBuilder, SaysWhichFileCannotBeWritten) {
  try {
    write_cloud("/nowhere/map.pcd", {}, CloudFormat::kPcd);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere/map.pcd"));
  }
}

}  // namespace
}  // namespace fdi_lio::mapping
