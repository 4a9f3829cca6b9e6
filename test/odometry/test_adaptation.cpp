#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "fdi_lio/odometry/adaptation.hpp"

namespace fdi_lio::odometry {
namespace {

using degeneracy::EnvironmentClass;

degeneracy::Degeneracy state(double fdi, EnvironmentClass environment = EnvironmentClass::kMixed) {
  degeneracy::Degeneracy result;
  result.fdi = fdi;
  result.environment = environment;
  return result;
}

AdaptationConfig all_off() {
  AdaptationConfig config;
  config.voxel = config.iterations = config.weights = config.noise = config.keyframes = false;
  return config;
}

void expect_base(const AdaptedSettings& settings, const MappingConfig& base) {
  EXPECT_EQ(settings.iterations, base.base_iterations);
  EXPECT_DOUBLE_EQ(settings.feature_voxel_m, base.feature_voxel_m);
  EXPECT_DOUBLE_EQ(settings.plane_weight, base.plane_weight);
  EXPECT_DOUBLE_EQ(settings.edge_weight, base.edge_weight);
  EXPECT_DOUBLE_EQ(settings.noise_scale, 1.0);
  EXPECT_DOUBLE_EQ(settings.keyframe_distance_m, base.keyframe_distance_m);
}

TEST(Adaptation, SwitchedOffNothingDependsOnTheDegeneracy) {
  const MappingConfig base;
  for (const double fdi : {0.0, 0.4, 1.0}) {
    for (const auto environment : {EnvironmentClass::kStructured, EnvironmentClass::kSparse}) {
      expect_base(adapt(all_off(), base, state(fdi, environment)), base);
    }
  }
}

TEST(Adaptation, EachSwitchChangesItsOwnSettingsOnly) {
  const MappingConfig base;
  const AdaptedSettings off = adapt(all_off(), base, state(0.8, EnvironmentClass::kSparse));
  bool AdaptationConfig::*const switches[] = {&AdaptationConfig::voxel, &AdaptationConfig::iterations,
                                              &AdaptationConfig::weights, &AdaptationConfig::noise,
                                              &AdaptationConfig::keyframes};
  for (std::size_t k = 0; k < 5; ++k) {
    AdaptationConfig config = all_off();
    config.*switches[k] = true;
    const AdaptedSettings on = adapt(config, base, state(0.8, EnvironmentClass::kSparse));
    EXPECT_EQ(on.feature_voxel_m != off.feature_voxel_m, k == 0);
    EXPECT_EQ(on.iterations != off.iterations, k == 1);
    EXPECT_EQ(on.edge_weight != off.edge_weight, k == 2);
    EXPECT_EQ(on.noise_scale != off.noise_scale, k == 3);
    EXPECT_EQ(on.keyframe_distance_m != off.keyframe_distance_m, k == 4);
  }
}

TEST(Adaptation, VoxelIsLargerInStructuredAndSmallerInDegradedSurroundings) {
  MappingConfig base;
  base.feature_voxel_m = 0.4;
  AdaptationConfig config;
  config.voxel = true;
  config.voxel_gain = 0.25;
  EXPECT_NEAR(adapt(config, base, state(0.0)).feature_voxel_m, 0.5, 1e-12);
  EXPECT_NEAR(adapt(config, base, state(0.5)).feature_voxel_m, 0.4, 1e-12);
  EXPECT_NEAR(adapt(config, base, state(1.0)).feature_voxel_m, 0.3, 1e-12);
}

TEST(Adaptation, IterationsFollowTheIndex) {
  MappingConfig base;
  base.base_iterations = 4;
  AdaptationConfig config;
  config.iterations = true;
  config.iterations_gain = 0.5;
  EXPECT_EQ(adapt(config, base, state(0.0)).iterations, 4);
  EXPECT_EQ(adapt(config, base, state(0.5)).iterations, 5);
  EXPECT_EQ(adapt(config, base, state(1.0)).iterations, 6);
  EXPECT_EQ(adapt(config, base, state(0.2)).iterations, 4);  // 4.4
  EXPECT_EQ(adapt(config, base, state(0.3)).iterations, 5);  // 4.6
}

TEST(Adaptation, PlanesWeighMoreInStructuredEdgesInSparseSurroundings) {
  MappingConfig base;
  base.plane_weight = 2.0;
  base.edge_weight = 0.1;
  AdaptationConfig config;
  config.weights = true;
  config.plane_gain = 0.5;
  config.edge_gain = 3.0;
  const auto structured = adapt(config, base, state(0.5, EnvironmentClass::kStructured));
  EXPECT_DOUBLE_EQ(structured.plane_weight, 3.0);
  EXPECT_DOUBLE_EQ(structured.edge_weight, 0.1);
  const auto sparse = adapt(config, base, state(0.5, EnvironmentClass::kSparse));
  EXPECT_DOUBLE_EQ(sparse.plane_weight, 2.0);
  EXPECT_DOUBLE_EQ(sparse.edge_weight, 0.4);
  for (const auto other : {EnvironmentClass::kDynamic, EnvironmentClass::kMixed}) {
    EXPECT_DOUBLE_EQ(adapt(config, base, state(0.5, other)).plane_weight, 2.0);
    EXPECT_DOUBLE_EQ(adapt(config, base, state(0.5, other)).edge_weight, 0.1);
  }
}

TEST(Adaptation, NoiseGrowsWithTheIndex) {
  AdaptationConfig config;
  config.noise = true;
  config.noise_gain = 3.0;
  EXPECT_DOUBLE_EQ(adapt(config, MappingConfig(), state(0.0)).noise_scale, 1.0);
  EXPECT_DOUBLE_EQ(adapt(config, MappingConfig(), state(0.5)).noise_scale, 2.5);
  EXPECT_DOUBLE_EQ(adapt(config, MappingConfig(), state(1.0)).noise_scale, 4.0);
}

TEST(Adaptation, KeyframesGetDenserWithTheIndex) {
  MappingConfig base;
  base.keyframe_distance_m = 2.0;
  AdaptationConfig config;
  config.keyframes = true;
  config.keyframe_decay = std::log(4.0);
  config.keyframe_gain = 0.5;
  config.keyframe_least_distance_m = 0.1;
  EXPECT_NEAR(adapt(config, base, state(0.0)).keyframe_distance_m, 2.1, 1e-12);
  EXPECT_NEAR(adapt(config, base, state(0.5)).keyframe_distance_m, (1.0 + 0.1) * 0.75, 1e-12);
  EXPECT_NEAR(adapt(config, base, state(1.0)).keyframe_distance_m, (0.5 + 0.1) * 0.5, 1e-12);
}

TEST(Adaptation, AnIndexOutOfRangeOrNotFiniteDoesNoHarm) {
  const MappingConfig base;
  const AdaptationConfig config;
  EXPECT_DOUBLE_EQ(adapt(config, base, state(7.0)).noise_scale, adapt(config, base, state(1.0)).noise_scale);
  EXPECT_DOUBLE_EQ(adapt(config, base, state(-7.0)).noise_scale, 1.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_DOUBLE_EQ(adapt(config, base, state(nan)).feature_voxel_m,
                   adapt(config, base, state(0.0)).feature_voxel_m);
}

}  // namespace
}  // namespace fdi_lio::odometry
