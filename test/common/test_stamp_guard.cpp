#include <gtest/gtest.h>

#include "fdi_lio/common/stamp_guard.hpp"

namespace fdi_lio {
namespace {

class Guard : public testing::Test {
 protected:
  StampVerdict check(double seconds) { return guard_.check(to_nanoseconds(1000.0 + seconds)); }

  StampGuard guard_;
};

TEST_F(Guard, AcceptsScansThatFollow) {
  for (int i = 0; i < 5; ++i) EXPECT_EQ(check(0.1 * i), StampVerdict::kAccept) << i;
}

TEST_F(Guard, AcceptsAfterAGap) {
  EXPECT_EQ(check(0.0), StampVerdict::kAccept);
  EXPECT_EQ(check(9.9), StampVerdict::kAccept);
}

TEST_F(Guard, DropsRepeatedAndLateScans) {
  EXPECT_EQ(check(0.0), StampVerdict::kAccept);
  EXPECT_EQ(check(0.0), StampVerdict::kDrop);
  EXPECT_EQ(check(-0.1), StampVerdict::kDrop);
  EXPECT_EQ(check(-9.9), StampVerdict::kDrop);
  EXPECT_EQ(check(0.1), StampVerdict::kAccept);
}

TEST_F(Guard, OneWrongStampCostsOneScan) {
  for (const double wrong : {3600.0, -3600.0, -1000.0}) {
    StampGuard guard;
    const auto at = [](double seconds) { return to_nanoseconds(1000.0 + seconds); };
    EXPECT_EQ(guard.check(at(0.0)), StampVerdict::kAccept);
    EXPECT_EQ(guard.check(at(wrong)), StampVerdict::kDrop);
    EXPECT_EQ(guard.check(at(0.2)), StampVerdict::kAccept);
    // What came before confirms nothing.
    EXPECT_EQ(guard.check(at(wrong + 0.2)), StampVerdict::kDrop);
    EXPECT_EQ(guard.check(at(0.4)), StampVerdict::kAccept);
  }
}

TEST_F(Guard, AConfirmedJumpIsARestartInEitherDirection) {
  EXPECT_EQ(check(0.0), StampVerdict::kAccept);
  EXPECT_EQ(check(-100.0), StampVerdict::kDrop);
  EXPECT_EQ(check(-99.9), StampVerdict::kRestart);
  EXPECT_EQ(check(-99.8), StampVerdict::kAccept);
  EXPECT_EQ(check(3600.0), StampVerdict::kDrop);
  EXPECT_EQ(check(3600.1), StampVerdict::kRestart);
  EXPECT_EQ(check(3600.2), StampVerdict::kAccept);
}

TEST(Jump, IsALongStepInEitherDirection) {
  const Stamp now = to_nanoseconds(1000.0);
  for (const double step : {10.1, -10.1, 3600.0}) EXPECT_TRUE(is_jump(now, add_seconds(now, step))) << step;
  for (const double step : {9.9, -9.9, 0.0}) EXPECT_FALSE(is_jump(now, add_seconds(now, step))) << step;
}

TEST_F(Guard, AFrozenOrWildClockConfirmsNothing) {
  EXPECT_EQ(check(0.0), StampVerdict::kAccept);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(check(500.0), StampVerdict::kDrop);
  EXPECT_EQ(check(700.0), StampVerdict::kDrop);
  EXPECT_EQ(check(900.0), StampVerdict::kDrop);
  EXPECT_EQ(check(0.1), StampVerdict::kAccept);
}

TEST_F(Guard, AFirstWrongStampIsGivenUp) {
  EXPECT_EQ(check(1e6), StampVerdict::kAccept);
  EXPECT_EQ(check(0.0), StampVerdict::kDrop);
  EXPECT_EQ(check(0.1), StampVerdict::kRestart);
  EXPECT_EQ(check(0.2), StampVerdict::kAccept);
}

}  // namespace
}  // namespace fdi_lio
