#include <gtest/gtest.h>

#include "fdi_lio/common/feedback.hpp"

namespace fdi_lio {
namespace {

struct Said {
  Stamp stamp;
  int value;
};

constexpr Stamp kSecond = 1000000000;

TEST(Feedback, IsThatOfTheNewestEarlierScan) {
  Feedback<Said> feedback(1.0);
  EXPECT_FALSE(feedback.before(10 * kSecond));
  feedback.add({9 * kSecond, 1});
  feedback.add({19 * kSecond / 2, 2});
  ASSERT_TRUE(feedback.before(10 * kSecond));
  EXPECT_EQ(feedback.before(10 * kSecond)->value, 2);
}

TEST(Feedback, LateAndRepeatedOnesChangeNothing) {
  Feedback<Said> feedback(1.0);
  feedback.add({19 * kSecond / 2, 2});
  feedback.add({9 * kSecond, 1});
  feedback.add({19 * kSecond / 2, 3});
  EXPECT_EQ(feedback.before(10 * kSecond)->value, 2);
}

TEST(Feedback, MissingOnesAreReplacedByTheLastForAWhile) {
  Feedback<Said> feedback(1.0);
  feedback.add({10 * kSecond, 1});
  EXPECT_TRUE(feedback.before(11 * kSecond));
  EXPECT_FALSE(feedback.before(11 * kSecond + 1));
}

TEST(Feedback, OfTheScanItselfOrOfALaterOneIsNotUsed) {
  Feedback<Said> feedback(1.0);
  feedback.add({10 * kSecond, 1});
  EXPECT_FALSE(feedback.before(10 * kSecond));
  EXPECT_FALSE(feedback.before(9 * kSecond));
}

TEST(Feedback, StampsMayStartAnew) {
  Feedback<Said> feedback(1.0);
  feedback.add({10 * kSecond, 1});
  feedback.reset();
  feedback.add({kSecond, 2});
  EXPECT_EQ(feedback.before(kSecond + 1)->value, 2);
}

}  // namespace
}  // namespace fdi_lio
