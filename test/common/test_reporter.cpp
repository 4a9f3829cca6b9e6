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

}  // namespace
}  // namespace fdi_lio
