#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "fdi_lio/common/config_io.hpp"
#include "fdi_lio/common/error.hpp"

namespace fdi_lio {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A file in a folder of this test's own.
class ConfigFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("fdi_lio_config_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }

  static std::string error_of(const std::string& path, const std::vector<std::string>& overrides = {}) {
    try {
      load_config(path, overrides);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path folder_;
};

TEST_F(ConfigFile, EmptyPathGivesDefaults) { EXPECT_EQ(load_config("", {}).mapping.window_size, 4); }

TEST_F(ConfigFile, ListsEveryErrorAtOnceWithParameterAndFile) {
  const std::string path =
      write("bad.yaml", "mapping:\n  window_size: 1000\n  typo: 3\nimu:\n  max_gap: soon\n");
  EXPECT_THAT(error_of(path), AllOf(HasSubstr("3 error(s)"), HasSubstr("'mapping.window_size'"),
                                    HasSubstr("2 to 20"), HasSubstr("unknown parameter 'mapping.typo'"),
                                    HasSubstr("'imu.max_gap'"), HasSubstr("bad.yaml:2")));
}

TEST_F(ConfigFile, RefusesWhatIsNoRotation) {
  EXPECT_THAT(error_of("", {"sensor.T_imu_lidar.rotation=[1,0,0, 0,1,0, 0,0,-1]"}),
              HasSubstr("determinant -1"));
  EXPECT_THAT(error_of("", {"sensor.T_imu_lidar.rotation=[0,0,0,2]"}), HasSubstr("norm 2"));
  EXPECT_THAT(error_of("", {"sensor.T_imu_lidar.rotation=[1,0,0]"}), HasSubstr("quaternion"));
}

TEST_F(ConfigFile, ReadsARotationMatrixAsTheSameRotationAsItsQuaternion) {
  const Config a = load_config("", {"sensor.T_imu_lidar.rotation=[0,-1,0, 1,0,0, 0,0,1]"});
  const Config b = load_config("", {"sensor.T_imu_lidar.rotation=[0,0,0.70710678,0.70710678]"});
  EXPECT_NEAR(a.sensor.q_imu_lidar.angularDistance(b.sensor.q_imu_lidar), 0.0, 1e-7);
}

TEST_F(ConfigFile, IncludesAreOverriddenByTheIncludingFileAndThatByTheCommandLine) {
  write("base.yaml", "mapping: {window_size: 5, base_iterations: 6, map_voxel: 0.5}\n");
  const std::string path =
      write("top.yaml", "include: [base.yaml]\nmapping: {base_iterations: 7, map_voxel: 0.6}\n");
  const Config config = load_config(path, {"mapping.map_voxel=0.7"});
  EXPECT_EQ(config.mapping.window_size, 5);
  EXPECT_EQ(config.mapping.base_iterations, 7);
  EXPECT_DOUBLE_EQ(config.mapping.map_voxel_m, 0.7);
}

TEST_F(ConfigFile, WhatIsWrittenReadsBackTheSame) {
  Config config = load_config("", {"mapping.map_voxel=0.123456789", "sensor.deskew=already_done"});
  std::ostringstream first;
  write_config(config, first);
  std::ostringstream second;
  write_config(load_config(write("run.yaml", first.str()), {}), second);
  EXPECT_EQ(first.str(), second.str());
  EXPECT_THAT(first.str(), HasSubstr("0.123456789"));
}

TEST_F(ConfigFile, MissingFileIsNamed) {
  EXPECT_THAT(error_of("/nowhere/x.yaml"), HasSubstr("/nowhere/x.yaml"));
}

TEST(ShippedFiles, EveryConfigurationLoads) {
  int loaded = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(FDI_LIO_SOURCE_DIR) + "/config")) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NO_THROW(load_config(entry.path().string(), {})) << entry.path();
    ++loaded;
  }
  EXPECT_GE(loaded, 6);
}

TEST(ShippedFiles, ParameterTableOfTheDocsIsTheDeclaration) {
  std::ifstream file(std::string(FDI_LIO_SOURCE_DIR) + "/docs/parameters.md");
  std::stringstream text;
  text << file.rdbuf();
  std::ostringstream table;
  write_parameter_table(table);
  EXPECT_NE(text.str().find(table.str()), std::string::npos)
      << "docs/parameters.md is out of date: run scripts/update_parameter_docs.sh";
}

}  // namespace
}  // namespace fdi_lio
