#include "fdi_lio/simulation/scenario.hpp"

#include <filesystem>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::simulation {
namespace {

using testing::HasSubstr;

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Scenario, EveryShippedFileLoads) {
  int count = 0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(FDI_LIO_SCENARIOS)) {
    if (!file.is_regular_file()) continue;
    EXPECT_NO_THROW(load_scenario(file.path().string(), {})) << file.path();
    ++count;
  }
  EXPECT_GE(count, 24);
}

TEST(Scenario, HardVariantsBuildOnTheNormalOnes) {
  const std::string folder = FDI_LIO_SCENARIOS;
  const Scenario normal = load_scenario(folder + "/tunnel.yaml", {}),
                 hard = load_scenario(folder + "/tunnel_hard.yaml", {});
  EXPECT_EQ(hard.world.type, "tunnel");
  EXPECT_EQ(hard.duration_s, normal.duration_s);
  EXPECT_LT(hard.world.marks, normal.world.marks);
}

TEST(Scenario, ListsAllUnknownKeysAndBadValuesAtOnce) {
  const std::string folder = FDI_LIO_SCENARIOS;
  const std::string text = message_of([&] {
    load_scenario(folder + "/street.yaml",
                  {"world.cats=3", "lidar.model=sick", "imu.rate=1e9", "duration=-2", "flavour=1"});
  });
  for (const char* part : {"5 error(s)", "world.cats", "sick", "imu.rate", "duration", "flavour", "hdl64e"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
}

TEST(Scenario, UnknownFileIsAnError) {
  EXPECT_THAT(message_of([] { load_scenario("/nowhere/else.yaml", {}); }), HasSubstr("unknown scenario"));
}

TEST(Scenario, WrittenAndReadBackIsTheSame) {
  const std::string folder = FDI_LIO_SCENARIOS;
  const Scenario scenario = load_scenario(folder + "/handheld_hard.yaml", {});
  std::ostringstream first, second;
  write_scenario(scenario, first, 0);
  const std::string path = testing::TempDir() + "/scenario_test_copy.yaml";
  std::ofstream(path) << first.str();
  write_scenario(load_scenario(path, {}), second, 0);
  EXPECT_EQ(first.str(), second.str());
  EXPECT_THAT(first.str(), HasSubstr("shake: 3"));
}

}  // namespace
}  // namespace fdi_lio::simulation
