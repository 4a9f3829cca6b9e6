#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/simulation/imu_simulator.hpp"
#include "fdi_lio/simulation/scenario.hpp"
#include "fdi_lio/simulation/world_builder.hpp"

namespace fdi_lio::simulation {
namespace {

/// What the one who carries the IMU can do.
struct Limits {
  double along;     ///< |specific force| along x, m/s^2
  double sideways;  ///< along y
  double vertical;  ///< |specific force along z - g|
  double rate;      ///< |angular velocity|, rad/s
};

/// Tyres hold about 0.9 g and drivers in traffic stay below 0.5 g; a tilt of the road or of the body on its
/// springs adds g times its sine (6 deg: 1 m/s^2). A road shakes the body by less than 0.5 g. A car turns by
/// 90 deg in no less than 1.5 s.
constexpr Limits kOnRoad{5.0, 5.0, 4.9, 1.1};

/// Off the road the wheels still touch the ground, which they do not beyond 1 g.
constexpr Limits kOffRoad{5.0, 5.0, 9.0, 1.1};

/// Who walks down stairs or jogs shakes what is in the hand by less than 2 g; it is tilted by up to about 45
/// deg.
constexpr Limits kHand{15.0, 15.0, 19.6, 4.0};

const Limits& limits_of(const Scenario& scenario) {
  if (scenario.motion.type == "handheld") return kHand;
  return scenario.world.type == "forest" || scenario.world.type == "mine" ? kOffRoad : kOnRoad;
}

std::vector<std::string> scenario_files() {
  std::vector<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(FDI_LIO_SCENARIOS)) {
    if (file.is_regular_file() && file.path().stem() != "kitti")
      names.push_back(file.path().stem().string());  // its poses are not shipped
  }
  std::sort(names.begin(), names.end());
  return names;
}

class ScenarioMotion : public testing::TestWithParam<std::string> {};

TEST_P(ScenarioMotion, IsWhatItsCarrierCanDo) {
  Scenario scenario = load_scenario(std::string(FDI_LIO_SCENARIOS) + "/" + GetParam() + ".yaml", {});
  scenario.world.cars = scenario.world.walkers = 0;  // they do not touch the motion, and take time to build
  scenario.imu.gyro_noise = scenario.imu.accel_noise = 0.0;
  scenario.imu.gyro_bias = scenario.imu.accel_bias = 0.0;
  scenario.imperfections.enabled = false;
  const Limits& limits = limits_of(scenario);
  const Place place = make_place(scenario, 21);
  ImuSimulator imu(*place.trajectory, scenario.imu, scenario.imperfections, 21);
  Limits most{0.0, 0.0, 0.0, 0.0};
  for (ImuReading reading = imu.next(); reading.time_s < scenario.duration_s; reading = imu.next()) {
    most.along = std::max(most.along, std::abs(reading.accel.x()));
    most.sideways = std::max(most.sideways, std::abs(reading.accel.y()));
    most.vertical = std::max(most.vertical, std::abs(reading.accel.z() - scenario.imu.gravity_mps2));
    most.rate = std::max(most.rate, reading.gyro.norm());
  }
  std::printf("%-16s along %.2f, sideways %.2f, vertical %.2f m/s^2, %.2f rad/s\n", GetParam().c_str(),
              most.along, most.sideways, most.vertical, most.rate);
  EXPECT_LT(most.along, limits.along);
  EXPECT_LT(most.sideways, limits.sideways);
  EXPECT_LT(most.vertical, limits.vertical);
  EXPECT_LT(most.rate, limits.rate);
}

TEST_P(ScenarioMotion, BeginsAtItsStartSpeed) {
  Scenario scenario = load_scenario(std::string(FDI_LIO_SCENARIOS) + "/" + GetParam() + ".yaml", {});
  scenario.world.cars = scenario.world.walkers = 0;
  const Place place = make_place(scenario, 22);
  const double speed = place.trajectory->evaluate(0.0).v_map.norm();
  if (scenario.motion.start_speed_mps > 0.0) {
    // It may begin in a bend, where the plan is slower.
    EXPECT_GT(speed, 0.5 * scenario.motion.start_speed_mps);
    EXPECT_LT(speed, 1.1 * scenario.motion.start_speed_mps);
  } else {
    EXPECT_LT(speed, 0.02);
  }
}

INSTANTIATE_TEST_SUITE_P(All, ScenarioMotion, testing::ValuesIn(scenario_files()),
                         [](const auto& info) { return info.param; });

}  // namespace
}  // namespace fdi_lio::simulation
