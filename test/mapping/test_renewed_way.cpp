#include <cmath>

#include <gtest/gtest.h>

#include "fdi_lio/mapping/renewed_way.hpp"

namespace fdi_lio::mapping {
namespace {

TEST(RenewedWay, WithinReachOfWhatIsSeenNothingIsRenewed) {
  RenewedWay way;
  // Up and down a hall for 400 m, and round it once.
  for (int k = 0; k < 400; ++k) EXPECT_EQ(way.advance({9.0 * std::sin(0.1 * k), 0.0, 0.0}, 10.0), 0.0);
  for (int k = 0; k < 60; ++k)
    EXPECT_EQ(way.advance({9.0 * std::cos(0.1 * k), 9.0 * std::sin(0.1 * k), 0.0}, 10.0), 0.0);
  EXPECT_EQ(way.way_m(), 0.0);
}

TEST(RenewedWay, BeyondTwoRadiiAStraightWayCountsInFull) {
  RenewedWay way;
  for (int k = 0; k <= 100; ++k) way.advance({1.0 * k, 0.0, 0.0}, 10.0);
  EXPECT_NEAR(way.way_m(), 80.0, 1e-12);
  EXPECT_NEAR(way.advance({101.5, 0.0, 0.0}, 10.0), 1.5, 1e-12);
  // Back again: 40 m until the anchor follows.
  for (int k = 0; k <= 40; ++k) EXPECT_EQ(way.advance({101.5 - k, 0.0, 0.0}, 10.0), 0.0) << k;
  EXPECT_NEAR(way.advance({51.5, 0.0, 0.0}, 10.0), 10.0, 1e-12);
}

TEST(RenewedWay, WhereNothingIsMatchedTheReachIsThatOfBefore) {
  RenewedWay way;
  way.advance({0.0, 0.0, 0.0}, 10.0);
  EXPECT_EQ(way.advance({15.0, 0.0, 0.0}, 0.0), 0.0);
  EXPECT_NEAR(way.advance({25.0, 0.0, 0.0}, 0.0), 5.0, 1e-12);
  RenewedWay unknown;
  unknown.advance({0.0, 0.0, 0.0}, 0.0);
  EXPECT_NEAR(unknown.advance({3.0, 4.0, 0.0}, 0.0), 5.0, 1e-12);
}

}  // namespace
}  // namespace fdi_lio::mapping
