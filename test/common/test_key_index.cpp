#include <random>
#include <unordered_map>

#include <gtest/gtest.h>

#include "fdi_lio/common/key_index.hpp"

namespace fdi_lio {
namespace {

TEST(KeyIndex, NumbersKeysInTheOrderInWhichTheyComeFirst) {
  std::mt19937_64 random(1);
  std::unordered_map<std::uint64_t, std::uint32_t> reference;
  KeyIndex index;
  for (int k = 0; k < 200000; ++k) {
    // Neighbouring voxels differ in few bits, low or high ones.
    const std::uint64_t key = (random() % 60) << 42U | (random() % 60) << 21U | random() % 20;
    const auto expected = static_cast<std::uint32_t>(reference.size());
    const auto [entry, is_new] = reference.try_emplace(key, expected);
    ASSERT_EQ(index.find_or_add(key), entry->second);
    ASSERT_EQ(index.size(), reference.size());
  }
  EXPECT_GT(reference.size(), 50000U);
}

TEST(KeyIndex, ForgetsWhatWasErasedAndNothingElse) {
  std::mt19937_64 random(2);
  std::unordered_map<std::uint64_t, std::uint32_t> reference;
  KeyIndex index;
  EXPECT_EQ(index.find(7), KeyIndex::kNone);
  index.erase(7);
  for (std::uint32_t k = 0; k < 300000; ++k) {
    const std::uint64_t key = (random() % 30) << 42U | (random() % 20) << 21U | random() % 20;
    if (random() % 3 == 0) {
      index.erase(key);
      reference.erase(key);
    } else {
      ASSERT_EQ(index.find_or_add(key, k), reference.try_emplace(key, k).first->second);
    }
    const std::uint64_t other = (random() % 30) << 42U | (random() % 20) << 21U | random() % 20;
    const auto entry = reference.find(other);
    ASSERT_EQ(index.find(other), entry == reference.end() ? KeyIndex::kNone : entry->second);
    ASSERT_EQ(index.size(), reference.size());
  }
  EXPECT_GT(reference.size(), 5000U);
}

TEST(KeyIndex, TakesAnyKey) {
  KeyIndex index;
  for (const std::uint64_t key : {~0ULL, 0ULL, 1ULL << 63U, ~0ULL}) index.find_or_add(key);
  EXPECT_EQ(index.size(), 3U);
  EXPECT_EQ(index.find_or_add(0), 1U);
}

}  // namespace
}  // namespace fdi_lio
