#include <gtest/gtest.h>

#include "fdi_lio/mapping/keyframe_store.hpp"

namespace fdi_lio::mapping {
namespace {

KeyframeCloud cloud_of(int number) {
  KeyframeCloud cloud;
  cloud.surface.resize(100);
  cloud.planes.resize(10);
  cloud.edges.resize(3);
  for (auto* points : {&cloud.surface, &cloud.planes, &cloud.edges}) {
    for (std::size_t k = 0; k < points->size(); ++k) {
      (*points)[k].position = Eigen::Vector3f(number, k, points->size());
      (*points)[k].intensity = static_cast<float>(number + k);
    }
  }
  return cloud;
}

TEST(KeyframeStore, GivesBackWhatWasPagedOut) {
  constexpr std::size_t kLimit = 3 * 113 * sizeof(Point);
  KeyframeStore store(kLimit);
  for (int number = 0; number < 50; ++number) {
    store.add(cloud_of(number));
    EXPECT_LE(store.bytes_in_memory(), kLimit);
  }
  for (const int number : {0, 49, 17, 0, 33}) {
    const auto cloud = store.get(number);
    const KeyframeCloud expected = cloud_of(number);
    ASSERT_EQ(cloud->surface.size(), expected.surface.size());
    ASSERT_EQ(cloud->edges.size(), expected.edges.size());
    EXPECT_EQ(cloud->planes[7].position, expected.planes[7].position);
    EXPECT_EQ(cloud->edges[2].intensity, expected.edges[2].intensity);
    EXPECT_LE(store.bytes_in_memory(), kLimit);
  }
  EXPECT_THROW(store.get(50), std::out_of_range);
}

TEST(KeyframeStore, ASmallerLimitHoldsFromTheNextCloudOn) {
  constexpr std::size_t kBytes = 113 * sizeof(Point);
  KeyframeStore store(8 * kBytes);
  for (int number = 0; number < 8; ++number) store.add(cloud_of(number));
  EXPECT_EQ(store.bytes_in_memory(), 8 * kBytes);
  store.set_memory_limit(2 * kBytes);
  store.add(cloud_of(8));
  EXPECT_EQ(store.bytes_in_memory(), 2 * kBytes);
  for (int number = 0; number < 9; ++number)
    EXPECT_EQ(store.get(static_cast<std::size_t>(number))->surface[5].position,
              cloud_of(number).surface[5].position);
}

TEST(KeyframeStore, AnotherCloudTakesThePlace) {
  constexpr std::size_t kLimit = 3 * 113 * sizeof(Point);
  KeyframeStore store(kLimit);
  for (int number = 0; number < 10; ++number) store.add(cloud_of(number));
  for (const int number : {1, 9}) {  // paged out, and in memory
    store.replace(static_cast<std::size_t>(number), cloud_of(100 + number));
    EXPECT_LE(store.bytes_in_memory(), kLimit);
  }
  for (int number = 0; number < 10; ++number) {
    const int expected = number == 1 || number == 9 ? 100 + number : number;
    EXPECT_EQ(store.get(static_cast<std::size_t>(number))->surface[5].position,
              cloud_of(expected).surface[5].position);
  }
}

TEST(KeyframeStore, CloudInUseOutlivesItsPaging) {
  KeyframeStore store(1);
  store.add(cloud_of(1));
  const auto cloud = store.get(0);
  store.add(cloud_of(2));
  EXPECT_EQ(cloud->surface[0].position.x(), 1.0F);
}

}  // namespace
}  // namespace fdi_lio::mapping
