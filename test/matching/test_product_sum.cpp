#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/matching/product_sum.hpp"

namespace fdi_lio::matching {
namespace {

/// Residuals that are summed by Eigen and by a ProductSum.
struct Both {
  Matrix6d H = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
  ProductSum sum;

  void add(int count, unsigned seed) {
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal(0.0, 3.0);
    for (int k = 0; k < count; ++k) {
      const double w = std::abs(normal(generator));
      const double r = normal(generator);
      Vector6d J;
      for (int i = 0; i < 6; ++i) J[i] = normal(generator);
      H += w * J * J.transpose();
      b += w * r * J;
      sum.add(w, J, r);
    }
  }
};

class ProductSums : public testing::TestWithParam<int> {};

TEST_P(ProductSums, AreThoseOfEigen) {
  Both both;
  both.add(GetParam(), 1);
  EXPECT_LT((both.sum.H() - both.H).norm(), 1e-12 * (1.0 + both.H.norm()));
  EXPECT_LT((both.sum.b() - both.b).norm(), 1e-12 * (1.0 + both.b.norm()));
}

// Fewer than are summed together, just as many, and more.
INSTANTIATE_TEST_SUITE_P(Counts, ProductSums, testing::Values(0, 1, 15, 16, 17, 1000));

TEST(ProductSum, GoesOnAfterItWasAskedAndAddsAnother) {
  Both both;
  both.add(21, 2);
  EXPECT_LT((both.sum.H() - both.H).norm(), 1e-12 * both.H.norm());
  both.add(9, 3);
  Both other;
  other.add(5, 4);
  both.sum.add(other.sum);
  EXPECT_LT((both.sum.H() - both.H - other.H).norm(), 1e-12 * both.H.norm());
  EXPECT_LT((both.sum.b() - both.b - other.b).norm(), 1e-12 * (1.0 + both.b.norm()));
}

}  // namespace
}  // namespace fdi_lio::matching
