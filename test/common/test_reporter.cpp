#include <thread>

#include <gtest/gtest.h>

#include "fdi_lio/common/reporter.hpp"

namespace fdi_lio {
namespace {

TEST(Reporter, CountsEveryOccurrenceButHandsOutPowersOfTen) {
  Reporter reporter;
  std::size_t handed_out = 0;
  for (int i = 0; i < 150; ++i) {
    reporter.report(Severity::kWarning, "key", "text");
    handed_out += reporter.take_new().size();
  }
  EXPECT_EQ(reporter.notices().at("key").count, 150U);
  EXPECT_EQ(handed_out, 3U);  // 1, 10, 100
}

TEST(Reporter, ThreadsMayShareOne) {
  Reporter reporter;
  const auto report = [&reporter] {
    for (int i = 0; i < 10000; ++i) reporter.report(Severity::kInfo, "key", "text");
  };
  std::thread other(report);
  report();
  other.join();
  EXPECT_TRUE(reporter.has("key"));
  EXPECT_FALSE(reporter.has("another"));
  EXPECT_EQ(reporter.notices().at("key").count, 20000U);
}

}  // namespace
}  // namespace fdi_lio
