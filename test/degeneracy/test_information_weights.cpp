#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "fdi_lio/common/error.hpp"
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

TEST(ParseReference, NormalisesTheNumbersAndFallsBackToTheDecay) {
  EXPECT_EQ(parse_reference("1 2.5e0 \n 1.5", "name", 3, 0.3), (std::vector<double>{0.2, 0.5, 0.3}));
  EXPECT_EQ(parse_reference(" ", "name", 10, 0.3), reference_distribution(10, 0.3));
}

TEST(ParseReference, NamesTheParameterThatDoesNotFit) {
  for (const char* text :
       {"0.5 0.5", "0.5 0.5 0", "0.2 0.3 -0.5", "0.2 0.3 x", "0.2 0.3 0.4 0.1", "nan 1 1"}) {
    try {
      parse_reference(text, "degeneracy.reference_sparse", 3, 0.3);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("degeneracy.reference_sparse"), std::string::npos);
    }
  }
}

TEST(InformationWeights, MeasureEachSubFactorAgainstItsOwnReference) {
  DegeneracyConfig config;
  config.histogram_bins = 2;
  config.window_scans = 1000;
  config.histogram_smoothing = 1e-6;
  config.weight_entropy = 0.0;
  config.weight_divergence = 1.0;
  config.weight_floor = 0.1;
  config.reference_structural = "0.9 0.1";
  config.reference_sparse = "0.5 0.5";
  config.reference_dynamic = "0.1 0.9";
  InformationWeights weights(config);
  for (int i = 0; i < 1000; ++i) weights.push({0.9, 0.9, 0.9});
  // p = (0, 1): D_k = -ln q_k1 and D_max = -ln min_b q_kb.
  const std::array<double, 3> i_k{0.1 + 1.0, 0.1 + 1.0, 0.1 + std::log(0.9) / std::log(0.1)};
  const std::array<double, 3> w = weights.weights();
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(w[k], i_k[k] / sum_of(i_k), 1e-6);
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
  DegeneracyConfig config;
  config.reference_structural = config.reference_sparse = config.reference_dynamic = "";
  InformationWeights weights(config);
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
  DegeneracyConfig config;
  config.reference_structural = config.reference_sparse = config.reference_dynamic = "";
  InformationWeights weights(config);
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
