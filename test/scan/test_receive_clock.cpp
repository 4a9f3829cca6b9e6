#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/scan/receive_clock.hpp"

namespace fdi_lio::scan {
namespace {

constexpr double kHostS = 1.7e9;  ///< what the host's clock reads when the sensor's reads 0
constexpr double kLeastDelayS = 0.004;

/// Scans every 0.1 s of a clock that is `drift` faster than the host's, received 4 to 30 ms late.
class Received : public testing::Test {
 protected:
  /// By how much the given stamps are behind the time at which the scans were taken [s].
  std::vector<double> errors(ReceiveClock* clock, double drift, int from, int to) {
    std::vector<double> result;
    for (int k = from; k < to; ++k) {
      const double true_s = 0.1 * k;
      const Stamp taken = to_nanoseconds(kHostS) + to_nanoseconds(true_s);
      const Stamp stamp = to_nanoseconds(true_s * (1.0 + drift));
      const Stamp received = add_seconds(taken, kLeastDelayS + delay_(engine_));
      result.push_back(seconds_between(taken, clock->to_received(stamp, received)));
    }
    return result;
  }

  std::mt19937 engine_{3};
  std::uniform_real_distribution<double> delay_{0.0, 0.026};
};

TEST_F(Received, StampsAreEvenAndLateByTheLeastDelay) {
  for (const double drift : {0.0, 2e-5, -2e-5}) {
    ReceiveClock clock;
    errors(&clock, drift, 0, 100);
    for (const double error_s : errors(&clock, drift, 100, 3000)) {
      EXPECT_GT(error_s, kLeastDelayS - 1e-6);
      EXPECT_LT(error_s, kLeastDelayS + 2.5e-3);
    }
  }
}

TEST_F(Received, AClockThatJumpsIsLearntAnew) {
  ReceiveClock clock;
  errors(&clock, 0.0, 0, 100);
  // The sensor was switched off and on: its clock begins anew while the host's goes on.
  const Stamp received = to_nanoseconds(kHostS + 60.0);
  EXPECT_EQ(clock.to_received(to_nanoseconds(1.0), received), received);
  const Stamp next = clock.to_received(to_nanoseconds(1.1), add_seconds(received, 0.12));
  EXPECT_NEAR(seconds_between(received, next), 0.1, 1e-4);
}

TEST_F(Received, AHoldUpDoesNotMoveTheStamps) {
  ReceiveClock clock;
  errors(&clock, 0.0, 0, 100);
  const Stamp taken = to_nanoseconds(kHostS + 10.0);
  const Stamp stamp = clock.to_received(to_nanoseconds(10.0), add_seconds(taken, 0.8));
  EXPECT_LT(seconds_between(taken, stamp), kLeastDelayS + 2.5e-3);
}

}  // namespace
}  // namespace fdi_lio::scan
