#include <gtest/gtest.h>

#include "fdi_lio/common/answer_gate.hpp"

namespace fdi_lio {
namespace {

constexpr double kTimeoutS = 0.3;

TEST(AnswerGate, WaitsUntilTheAnswerComes) {
  AnswerGate gate(kTimeoutS);
  EXPECT_FALSE(gate.is_open(100, 0.1));
  gate.answered(99);
  EXPECT_FALSE(gate.is_open(100, 0.1));
  EXPECT_FALSE(gate.has_answered(100));
  gate.answered(100);
  EXPECT_TRUE(gate.has_answered(100));
  EXPECT_TRUE(gate.is_open(100, 0.1));
  EXPECT_EQ(gate.timeouts(), 0U);
}

TEST(AnswerGate, AnswersThatAreRepeatedOrLateDoNotOpenIt) {
  AnswerGate gate(kTimeoutS);
  gate.answered(100);
  gate.answered(100);
  gate.answered(50);
  EXPECT_TRUE(gate.is_open(100, 0.0));
  EXPECT_FALSE(gate.is_open(101, 0.0));
}

TEST(AnswerGate, ADeadStageCostsOneWaitingTimeUntilItSpeaksAgain) {
  AnswerGate gate(kTimeoutS);
  EXPECT_FALSE(gate.is_open(100, 0.29));
  EXPECT_TRUE(gate.is_open(100, 0.31));
  EXPECT_TRUE(gate.is_open(200, 0.0));
  EXPECT_TRUE(gate.take_timeout());
  EXPECT_FALSE(gate.take_timeout());
  gate.answered(300);
  EXPECT_FALSE(gate.is_open(400, 0.0));
  EXPECT_EQ(gate.timeouts(), 1U);
}

TEST(AnswerGate, StampsMayStartAnew) {
  AnswerGate gate(kTimeoutS);
  gate.answered(1000);
  gate.reset();
  EXPECT_FALSE(gate.is_open(10, 0.0));
}

}  // namespace
}  // namespace fdi_lio
