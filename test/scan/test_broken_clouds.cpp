#include "reader_fixture.hpp"

namespace fdi_lio::scan {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::IsEmpty;

// --- points that are none ---

TEST_F(Reader, EmptyCloudIsDroppedAndNamed) {
  CloudBytes cloud = velodyne_cloud();
  cloud.bytes.clear();
  EXPECT_FALSE(read(cloud));
  EXPECT_THAT(warnings(), HasSubstr("no points"));
}

TEST_F(Reader, AllNanIsDroppedAndCounted) {
  CloudBytes cloud = velodyne_cloud();
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.set(i, "y", kNan);
  EXPECT_FALSE(read(cloud));
  EXPECT_THAT(warnings(), HasSubstr("3200 not finite"));
}

TEST_F(Reader, AllAtTheOriginIsDroppedAndCounted) {
  CloudBytes cloud = velodyne_cloud();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (const char* axis : {"x", "y", "z"}) cloud.set(i, axis, 0.0);
  }
  EXPECT_FALSE(read(cloud));
  EXPECT_THAT(warnings(), HasSubstr("3200 at the origin"));
}

TEST_F(Reader, SomeBadPointsAreCountedByReason) {
  CloudBytes cloud = velodyne_cloud();
  cloud.set(0, "x", kNan);
  cloud.set(1, "z", std::numeric_limits<float>::infinity());
  for (const char* axis : {"x", "y", "z"}) cloud.set(2, axis, 0.0);
  cloud.set(3, "x", 1e4);
  cloud.set(4, "x", 0.1), cloud.set(4, "y", 0.1), cloud.set(4, "z", 0.1);
  cloud.set(5, "ring", 1024);
  const auto scan = read(cloud);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->dropped.non_finite, 2U);
  EXPECT_EQ(scan->dropped.zero, 1U);
  EXPECT_EQ(scan->dropped.out_of_range, 3U);
  EXPECT_EQ(scan->points.size(), 3194U);
  EXPECT_THAT(warnings(), IsEmpty());
}

TEST_F(Reader, DuplicatesOnARingAreDropped) {
  CloudBytes cloud;
  const CloudBytes once = velodyne_cloud();
  cloud.point_step = once.point_step;
  cloud.fields = once.fields;
  for (std::size_t i = 0; i < once.size(); ++i) {
    const auto begin = once.bytes.begin() + static_cast<std::ptrdiff_t>(i * once.point_step);
    for (int copy = 0; copy < 2; ++copy)
      cloud.bytes.insert(cloud.bytes.end(), begin, begin + once.point_step);
  }
  const auto scan = read(cloud);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->points.size(), 3200U);
  EXPECT_EQ(scan->dropped.duplicate, 3200U);
}

TEST_F(Reader, APointWithoutTimeDoesNotHideItsDuplicate) {
  CloudBytes cloud = velodyne_cloud();
  // Points 0 and 16 are neighbours on ring 0; put the second where the first is.
  const Eigen::Vector3f p = Sweep::position(0, 0);
  cloud.set(16, "x", p.x()), cloud.set(16, "y", p.y()), cloud.set(16, "z", p.z());
  cloud.set(0, "time", kNan);
  const auto scan = read(cloud);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->points.size(), 3199U);
  EXPECT_EQ(scan->dropped.non_finite, 1U);
}

TEST_F(Reader, MoreRingsThanToldWidenTheScan) {
  CloudBytes cloud = velodyne_cloud();
  cloud.set(9, "ring", 127);
  EXPECT_EQ(read(cloud)->ring_count, 128);
}

// --- messages that contradict themselves ---

TEST_F(Reader, OddPointStepIsReadAsItIs) {
  expect_sweep(read(Sweep::cloud(27, velodyne_fields(), "time", 0.0, Sweep::kColumnS)), 1e-7);
}

TEST_F(Reader, BigEndianIsRefused) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  raw.is_bigendian = true;
  EXPECT_FALSE(read(raw));
  EXPECT_THAT(warnings(), HasSubstr("big-endian"));
}

TEST_F(Reader, PointStepThatIsTooSmallIsRefused) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  for (const std::uint32_t step : {0U, 11U, 21U}) {
    raw.point_step = step;
    EXPECT_FALSE(read(raw));
    EXPECT_THAT(warnings(), HasSubstr("(point_step)"));
    EXPECT_THAT(warnings(), HasSubstr("only " + std::to_string(step) + " bytes"));
  }
}

TEST_F(Reader, FieldBeyondThePointIsRefusedAndNamed) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  for (const std::uint32_t offset : {21U, 22U, 0xFFFFFFFFU}) {
    raw.fields[4].offset = offset;
    EXPECT_FALSE(read(raw));
    EXPECT_THAT(warnings(), HasSubstr("'ring'"));
  }
}

TEST_F(Reader, DataThatWasCutOffIsRefused) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  --raw.data_size;
  EXPECT_FALSE(read(raw));
  EXPECT_THAT(warnings(), HasSubstr("70399 bytes of data"));
  raw.data_size = 0;
  EXPECT_FALSE(read(raw));
  raw.data_size = cloud.bytes.size();
  raw.width = raw.height = 0xFFFFFFFF;
  EXPECT_FALSE(read(raw));
}

TEST_F(Reader, RowsThatOverlapAreRefused) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  raw.width = 200;
  raw.height = 16;
  raw.row_step = 199 * 22;
  EXPECT_FALSE(read(raw));
  EXPECT_THAT(warnings(), HasSubstr("row_step"));
}

TEST_F(Reader, RowStepOfZeroMeansPackedRows) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  raw.width = 200;
  raw.height = 16;
  raw.row_step = 0;
  expect_sweep(read(raw), 1e-7);
}

TEST_F(Reader, MissingOrIntegerCoordinatesAreNamed) {
  const CloudBytes cloud = velodyne_cloud();
  RawCloud raw = cloud.raw(kHeader);
  raw.fields[2].name = "height";
  EXPECT_FALSE(read(raw));
  EXPECT_THAT(warnings(), HasSubstr("'z'"));
  raw.fields[2].name = "z";
  raw.fields[1].datatype = kInt32;
  EXPECT_FALSE(read(raw));
  EXPECT_THAT(warnings(), HasSubstr("'y'"));
}

}  // namespace
}  // namespace fdi_lio::scan
