#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/mapping/map_builder.hpp"
#include "fdi_lio/mapping/map_file.hpp"

namespace fdi_lio::mapping {
namespace {

namespace fs = std::filesystem;

using Record = std::array<float, 4>;

class MapFile : public testing::Test {
 protected:
  MapFile() { fs::create_directory(folder_); }
  ~MapFile() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  fs::path folder_ = fs::temp_directory_path() / ("fdi_lio_map_file_" + std::to_string(getpid()));
};

struct Content {
  std::vector<std::string> header;
  std::vector<Record> records;
};

Content read(const std::string& path, const std::string& last_line) {
  Content content;
  std::ifstream in(path, std::ios::binary);
  for (std::string line; std::getline(in, line);) {
    content.header.push_back(line);
    if (line == last_line) break;
  }
  for (Record record; in.read(reinterpret_cast<char*>(record.data()), sizeof(record));)
    content.records.push_back(record);
  EXPECT_EQ(in.gcount(), 0) << "half a point at the end";
  return content;
}

TEST_F(MapFile, HasAsManyPointsAsItsHeaderSays) {
  Point point;
  point.position = Eigen::Vector3f(1.0F, -2.0F, 3.5F);
  point.intensity = 7.0F;
  for (const CloudFormat format : {CloudFormat::kPcd, CloudFormat::kPly}) {
    const std::string name = path(std::string("cloud.") + to_text(format));
    CloudFile file(name, format);
    for (int k = 0; k < 12; ++k) file.add(point);
    EXPECT_FALSE(fs::exists(name)) << "not before all of it is written";
    file.close();
    const bool is_ply = format == CloudFormat::kPly;
    const Content content = read(name, is_ply ? "end_header" : "DATA binary");
    EXPECT_THAT(content.header, testing::Contains(is_ply ? "element vertex 12" : "POINTS 12"));
    EXPECT_THAT(content.records,
                testing::ElementsAreArray(std::vector<Record>(12, Record{1.0F, -2.0F, 3.5F, 7.0F})));
  }
  EXPECT_THROW(to_cloud_format("las"), Error);
}

TEST_F(MapFile, OneThatIsNotClosedLeavesAnEarlierOneWhole) {
  const std::string name = path("cloud.pcd");
  {
    CloudFile file(name, CloudFormat::kPcd);
    file.add(Point());
    file.close();
  }
  {
    CloudFile file(name, CloudFormat::kPcd);
    file.add(Point());
    file.add(Point());
  }
  EXPECT_EQ(read(name, "DATA binary").records.size(), 1U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()), 1);
}

TEST_F(MapFile, SaysWhichFileCannotBeWritten) {
  try {
    CloudFile file("/nowhere/map.pcd", CloudFormat::kPcd);
    file.add(Point());
    file.close();
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nowhere/map.pcd"));
  }
}

/// Clouds along a way of 400 m, which reach over several tiles to each side of the origin.
MapSource make_source(std::size_t* loaded) {
  MapSource source;
  source.size = 20;
  source.cloud = [loaded](std::size_t k) {
    ++*loaded;
    std::mt19937 random(static_cast<std::uint32_t>(k));
    std::uniform_real_distribution<float> place(-60.0F, 60.0F);
    auto cloud = std::make_shared<KeyframeCloud>();
    for (int i = 0; i < 2000; ++i) {
      Point point;
      point.position = Eigen::Vector3f(place(random), place(random), 0.02F * place(random));
      point.intensity = place(random);
      cloud->surface.push_back(point);
    }
    return cloud;
  };
  source.T_map_imu = [](std::size_t k) {
    Eigen::Isometry3d T(Eigen::AngleAxisd(0.1 * static_cast<double>(k), Eigen::Vector3d::UnitZ()));
    T.pretranslate(Eigen::Vector3d(20.0 * static_cast<double>(k) - 200.0, 0.0, 0.0));
    return T;
  };
  return source;
}

/// In any order, up to the rounding of places in a tile.
void expect_same(std::vector<Record> found, std::vector<Record> expected) {
  std::sort(found.begin(), found.end());
  std::sort(expected.begin(), expected.end());
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (std::size_t k = 0; k < found[i].size(); ++k) EXPECT_NEAR(found[i][k], expected[i][k], 1e-4F);
  }
}

TEST_F(MapFile, APieceAtATimeItIsTheSameMap) {
  std::size_t loaded = 0;
  const MapSource source = make_source(&loaded);
  MapFileSettings settings;
  settings.voxel_m = 2.0;
  MapBuilder whole(settings.voxel_m);
  for (std::size_t k = 0; k < source.size; ++k) whole.add(source.cloud(k)->surface, source.T_map_imu(k));
  std::vector<Record> expected;
  whole.for_each([&](const Point& point) {
    expected.push_back({point.position.x(), point.position.y(), point.position.z(), point.intensity});
  });
  loaded = 0;
  write_map(source, &KeyframeCloud::surface, settings, path("map.pcd"));
  expect_same(read(path("map.pcd"), "DATA binary").records, expected);
  EXPECT_EQ(loaded, 2 * source.size);

  loaded = 0;
  settings.most_voxels = 3000;
  write_map(source, &KeyframeCloud::surface, settings, path("map.pcd"));
  expect_same(read(path("map.pcd"), "DATA binary").records, expected);
  EXPECT_GT(loaded, 3 * source.size) << "some of the keyframes for several pieces";
}

TEST_F(MapFile, WithoutKeyframesItIsEmpty) {
  write_map(MapSource(), &KeyframeCloud::surface, MapFileSettings(), path("map.pcd"));
  EXPECT_TRUE(read(path("map.pcd"), "DATA binary").records.empty());
}

}  // namespace
}  // namespace fdi_lio::mapping
