#include <cmath>

#include <gtest/gtest.h>

#include "fdi_lio/mapping/renewed_way.hpp"

namespace fdi_lio::mapping {
namespace {

/// How far it is renewed by going there.
double gain(RenewedWay* way, const Eigen::Vector3d& t_odom, double radius_m) {
  const double before_m = way->way_m();
  way->advance(t_odom, radius_m);
  return way->way_m() - before_m;
}

TEST(RenewedWay, WithinReachOfWhatIsSeenNothingIsRenewed) {
  RenewedWay way;
  // Up and down a hall, and round it.
  for (int k = 0; k < 400; ++k) way.advance({9.0 * std::sin(0.1 * k), 0.0, 0.0}, 10.0);
  for (int k = 0; k < 60; ++k) way.advance({9.0 * std::cos(0.1 * k), 9.0 * std::sin(0.1 * k), 0.0}, 10.0);
  EXPECT_EQ(way.way_m(), 0.0);
}

TEST(RenewedWay, BeyondTwoRadiiAStraightWayCountsInFull) {
  RenewedWay way;
  for (int k = 0; k <= 100; ++k) way.advance({1.0 * k, 0.0, 0.0}, 10.0);
  EXPECT_NEAR(way.way_m(), 80.0, 1e-12);
  EXPECT_NEAR(gain(&way, {101.5, 0.0, 0.0}, 10.0), 1.5, 1e-12);
  // Back again: 40 m until the anchor follows.
  for (int k = 0; k <= 40; ++k) EXPECT_EQ(gain(&way, {101.5 - k, 0.0, 0.0}, 10.0), 0.0) << k;
  EXPECT_NEAR(gain(&way, {51.5, 0.0, 0.0}, 10.0), 10.0, 1e-12);
}

TEST(RenewedWay, WhereNothingIsMatchedTheReachIsThatOfBefore) {
  RenewedWay way;
  way.advance({0.0, 0.0, 0.0}, 10.0);
  EXPECT_EQ(gain(&way, {15.0, 0.0, 0.0}, 0.0), 0.0);
  EXPECT_NEAR(gain(&way, {25.0, 0.0, 0.0}, 0.0), 5.0, 1e-12);
  RenewedWay unknown;
  unknown.advance({0.0, 0.0, 0.0}, 0.0);
  EXPECT_NEAR(gain(&unknown, {3.0, 4.0, 0.0}, 0.0), 5.0, 1e-12);
}

}  // namespace
}  // namespace fdi_lio::mapping
