#include <numeric>

#include <gtest/gtest.h>

#include "fdi_lio/degeneracy/environment_classifier.hpp"

namespace fdi_lio::degeneracy {
namespace {

constexpr std::array<double, 3> kGood{0.1, 0.1, 0.01};
constexpr std::array<double, 3> kEmpty{0.9, 0.2, 0.01};
constexpr std::array<double, 3> kBusy{0.1, 0.1, 0.9};
constexpr std::array<double, 3> kBoth{0.2, 0.9, 0.9};

TEST(ClassScores, SumToOneAndNameTheCorners) {
  for (const auto& sub : {kGood, kEmpty, kBusy, kBoth}) {
    const std::array<double, 4> scores = class_scores(sub, DegeneracyConfig{});
    EXPECT_NEAR(std::accumulate(scores.begin(), scores.end(), 0.0), 1.0, 1e-12);
  }
  const auto first = [](const std::array<double, 3>& sub) {
    return EnvironmentClassifier(DegeneracyConfig{}).update(sub);
  };
  EXPECT_EQ(first(kGood), EnvironmentClass::kStructured);
  EXPECT_EQ(first(kEmpty), EnvironmentClass::kSparse);
  EXPECT_EQ(first(kBusy), EnvironmentClass::kDynamic);
  EXPECT_EQ(first(kBoth), EnvironmentClass::kMixed);
}

TEST(ClassScores, AreEvenAtTheThresholds) {
  DegeneracyConfig config;
  config.class_poor_threshold = 0.7;
  config.class_dynamic_threshold = 0.2;
  for (const double score : class_scores({0.3, 0.7, 0.2}, config)) EXPECT_NEAR(score, 0.25, 1e-12);
  // Odds of 0.8 are 4, four times those of the threshold 0.5.
  config.class_poor_threshold = 0.5;
  EXPECT_NEAR(class_scores({0.8, 0.1, 0.0}, config)[1], 0.8, 1e-12);
}

TEST(EnvironmentClassifier, ChangesOnlyAfterTheHold) {
  DegeneracyConfig config;
  config.class_hold_scans = 3;
  EnvironmentClassifier classifier(config);
  classifier.update(kGood);
  EXPECT_EQ(classifier.update(kEmpty), EnvironmentClass::kStructured);
  EXPECT_EQ(classifier.update(kEmpty), EnvironmentClass::kStructured);
  EXPECT_EQ(classifier.update(kEmpty), EnvironmentClass::kSparse);
}

TEST(EnvironmentClassifier, StartsTheHoldAgainAfterAnInterruption) {
  DegeneracyConfig config;
  config.class_hold_scans = 3;
  EnvironmentClassifier classifier(config);
  classifier.update(kGood);
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(classifier.update(kEmpty), EnvironmentClass::kStructured);
    EXPECT_EQ(classifier.update(kEmpty), EnvironmentClass::kStructured);
    EXPECT_EQ(classifier.update(i % 2 == 0 ? kGood : kBusy), EnvironmentClass::kStructured);
  }
}

TEST(EnvironmentClassifier, IgnoresAWinWithinTheMargin) {
  DegeneracyConfig config;
  config.class_poor_threshold = 0.5;
  EnvironmentClassifier classifier(config);
  classifier.update({0.48, 0.0, 0.0});
  for (int i = 0; i < 50; ++i) EXPECT_EQ(classifier.update({0.53, 0.0, 0.0}), EnvironmentClass::kStructured);
  for (int i = 0; i < 5; ++i) classifier.update({0.6, 0.0, 0.0});
  EXPECT_EQ(classifier.current(), EnvironmentClass::kSparse);
}

}  // namespace
}  // namespace fdi_lio::degeneracy
