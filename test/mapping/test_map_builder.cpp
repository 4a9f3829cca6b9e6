#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"
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
  builder.write_pcd(path);
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

TEST(MapBuilder, SaysWhichFileCannotBeWritten) {
  try {
    MapBuilder(1.0).write_pcd("/nowhere/map.pcd");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere/map.pcd"));
  }
}

}  // namespace
}  // namespace fdi_lio::mapping
