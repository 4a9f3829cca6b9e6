#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "fdi_lio/degeneracy/information_weights.hpp"

namespace fdi_lio::degeneracy {
namespace {

double sum_of(const std::array<double, 3>& values) { return values[0] + values[1] + values[2]; }

TEST(Entropy, OfUniformIsLogarithmOfCountAndOfOneBinZero) {
  EXPECT_NEAR(entropy(std::vector<double>(8, 1.0 / 8)), std::log(8.0), 1e-12);
  EXPECT_DOUBLE_EQ(entropy({0.0, 1.0, 0.0}), 0.0);
}

TEST(KlDivergence, OfEqualDistributionsIsZero) {
  const std::vector<double> p{0.2, 0.3, 0.5};
  EXPECT_DOUBLE_EQ(kl_divergence(p, p), 0.0);
}

TEST(KlDivergence, FromUniformIsTheMissingEntropy) {
  const std::vector<double> p{0.1, 0.2, 0.3, 0.4};
  EXPECT_NEAR(kl_divergence(p, std::vector<double>(4, 0.25)), std::log(4.0) - entropy(p), 1e-12);
}

TEST(ReferenceDistribution, SumsToOneAndDecays) {
  const std::vector<double> q = reference_distribution(10, 0.3);
  EXPECT_NEAR(std::accumulate(q.begin(), q.end(), 0.0), 1.0, 1e-12);
  EXPECT_NEAR(q[1] / q[0], std::exp(-0.1 / 0.3), 1e-12);
  EXPECT_NEAR(reference_distribution(10, 1000.0)[9], 0.1, 1e-3);
}

TEST(SlidingHistogram, IsUniformBeforeTheFirstValueAndForgetsTheOldest) {
  SlidingHistogram histogram(4, 2, 0.5);
  EXPECT_EQ(histogram.distribution(), std::vector<double>(4, 0.25));
  histogram.push(0.0);
  EXPECT_NEAR(histogram.distribution()[0], 1.5 / 3.0, 1e-12);
  histogram.push(1.0);
  histogram.push(0.99);
  EXPECT_EQ(histogram.size(), 2U);
  EXPECT_NEAR(histogram.distribution()[0], 0.5 / 4.0, 1e-12);
  EXPECT_NEAR(histogram.distribution()[3], 2.5 / 4.0, 1e-12);
}

TEST(InformationWeights, AreEqualAtFirstAndForEqualHistories) {
  InformationWeights weights(DegeneracyConfig{});
  for (const double weight : weights.weights()) EXPECT_NEAR(weight, 1.0 / 3.0, 1e-12);
  for (int i = 0; i < 20; ++i) weights.push({0.3, 0.3, 0.3});
  for (const double weight : weights.weights()) EXPECT_NEAR(weight, 1.0 / 3.0, 1e-12);
}

TEST(InformationWeights, ArePositiveAndSumToOne) {
  InformationWeights weights(DegeneracyConfig{});
  for (int i = 0; i < 120; ++i) {
    weights.push({0.5 + 0.5 * std::sin(i), i % 3 == 0 ? 1.0 : 0.0, 0.7});
    const std::array<double, 3> w = weights.weights();
    EXPECT_NEAR(sum_of(w), 1.0, 1e-12);
    for (const double weight : w) EXPECT_GT(weight, 0.0);
  }
}

TEST(InformationWeights, GrowWithInformation) {
  InformationWeights weights(DegeneracyConfig{});
  for (int i = 0; i < 50; ++i) {
    const double spread = (i % 10 + 0.5) / 10.0;
    weights.push(
        {0.95, 0.05, spread});  // rare by the reference and certain; common and certain; uninformative
  }
  const std::array<double, 3> w = weights.weights();
  EXPECT_GT(w[0], w[1]);
  EXPECT_GT(w[1], w[2]);
}

}  // namespace
}  // namespace fdi_lio::degeneracy
