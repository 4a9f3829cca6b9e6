#include "reader_fixture.hpp"

namespace fdi_lio::scan {
namespace {

using namespace test;
using testing::HasSubstr;

// --- layouts of drivers ---

TEST_F(Reader, VelodyneLayout) {
  const auto scan = read(velodyne_cloud());
  expect_sweep(scan, 1e-7);
  EXPECT_TRUE(scan->has_intensity);
  EXPECT_FALSE(scan->time_from_azimuth);
  EXPECT_NEAR(seconds_between(kHeader, scan->stamp), Sweep::kLastS, 1e-8);
  EXPECT_NEAR(scan->duration_s, Sweep::kLastS, 1e-8);
  EXPECT_EQ(notice("cloud_layout"), "lidar format: ring 'ring', time 'time' in s, intensity 'intensity'");
}

TEST_F(Reader, OusterLayoutWithRingsOfEitherWidth) {
  for (const std::uint8_t ring_type : {kUint8, kUint16}) {
    const auto fields = xyz_and({{"intensity", 16, kFloat32},
                                 {"t", 20, kUint32},
                                 {"reflectivity", 24, kUint16},
                                 {"ring", 26, ring_type}});
    const auto scan = read(Sweep::cloud<std::uint32_t>(48, fields, "t", 7, 500000));
    expect_sweep(scan, 1e-7);
    EXPECT_EQ(scan->stamp, kHeader + 7 + 199 * 500000);
    EXPECT_THAT(notice("cloud_layout"), HasSubstr("time 't' in ns"));
  }
}

TEST_F(Reader, ReflectivityStandsInForIntensity) {
  const auto fields = xyz_and({{"reflectivity", 12, kUint16}, {"ring", 14, kUint8}, {"t", 16, kUint32}});
  const auto scan = read(Sweep::cloud<std::uint32_t>(20, fields, "t", 0, 500000));
  expect_sweep(scan, 1e-7);
  EXPECT_TRUE(scan->has_intensity);
}

TEST_F(Reader, LivoxLayout) {
  const auto fields = xyz_and(
      {{"intensity", 12, kFloat32}, {"tag", 16, kUint8}, {"line", 17, kUint8}, {"offset_time", 18, kUint32}});
  const auto scan = read(Sweep::cloud<std::uint32_t>(22, fields, "offset_time", 0, 500000));
  expect_sweep(scan, 1e-7);
  EXPECT_EQ(scan->stamp, kHeader + 199 * 500000);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("ring 'line', time 'offset_time' in ns"));
}

struct TimeUnit {
  double seconds;
  const char* name;
};

class FloatTimes : public Reader, public testing::WithParamInterface<TimeUnit> {};

TEST_P(FloatTimes, UnitIsRecognised) {
  const double step = Sweep::kColumnS / GetParam().seconds;
  const auto scan = read(Sweep::cloud(22, velodyne_fields(), "time", 0.0, step));
  expect_sweep(scan, 1e-7);
  EXPECT_NEAR(seconds_between(kHeader, scan->stamp), Sweep::kLastS, 1e-7);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr(GetParam().name));
}

INSTANTIATE_TEST_SUITE_P(Units, FloatTimes,
                         testing::Values(TimeUnit{1.0, "in s"}, TimeUnit{1e-3, "in ms"},
                                         TimeUnit{1e-6, "in us"}));

TEST_F(Reader, AbsoluteDoubleSeconds) {
  const auto fields = xyz_and({{"ring", 12, kUint16}, {"timestamp", 16, kFloat64}});
  const auto scan = read(Sweep::cloud(24, fields, "timestamp", to_seconds(kHeader) - 0.05, Sweep::kColumnS));
  expect_sweep(scan, 5e-7);
  // A double holds the seconds since 1970 to 0.24 microseconds.
  EXPECT_NEAR(seconds_between(kHeader, scan->stamp), Sweep::kLastS - 0.05, 5e-7);
}

TEST_F(Reader, AbsoluteIntegerNanosecondsAreExact) {
  const auto fields = xyz_and({{"ring", 12, kUint16}, {"timestamp", 14, kUint64}});
  const std::uint64_t first = kHeader + 1001;
  CloudBytes cloud = Sweep::cloud<std::uint64_t>(22, fields, "timestamp", first, 500000);
  // A shot without return comes first, and its time was left at zero.
  cloud.set(0, "timestamp", 0);
  for (const char* axis : {"x", "y", "z"}) cloud.set(0, axis, 0.0);
  const auto scan = read(cloud);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->stamp, kHeader + 1001 + 199 * 500000);
  EXPECT_EQ(to_nanoseconds(scan->duration_s), 199 * 500000);
  EXPECT_EQ(scan->dropped.zero, 1U);
}

TEST_F(Reader, TimesOfAnotherClockGiveOnlyDifferences) {
  const auto fields = xyz_and({{"ring", 12, kUint16}, {"timestamp", 14, kUint64}});
  const auto scan = read(Sweep::cloud<std::uint64_t>(22, fields, "timestamp", 50000000000, 500000));
  expect_sweep(scan, 1e-7);
  EXPECT_NEAR(seconds_between(kHeader, scan->stamp), Sweep::kLastS, 1e-8);
  EXPECT_THAT(notice("cloud_time_clock"), HasSubstr("another clock"));
}

TEST_F(Reader, NegativeTimesCountBackFromTheHeader) {
  const auto scan = read(Sweep::cloud(22, velodyne_fields(), "time", -Sweep::kLastS, Sweep::kColumnS));
  expect_sweep(scan, 1e-7);
  EXPECT_NEAR(seconds_between(kHeader, scan->stamp), 0.0, 1e-8);
}

// --- what the parameters say ---

TEST_F(Reader, StampAtTheEndIsThatOfTheLastPoint) {
  sensor_.stamp_at = "end";
  const auto scan = read(velodyne_cloud());
  expect_sweep(scan, 1e-7);
  EXPECT_EQ(scan->stamp, kHeader);
}

TEST_F(Reader, StampAtTheEndIsThatOfTheLastShotAlsoWithoutReturn) {
  sensor_.stamp_at = "end";
  CloudBytes cloud = velodyne_cloud();
  // The last ten columns met nothing.
  for (std::size_t i = cloud.size() - 160; i < cloud.size(); ++i) {
    for (const char* axis : {"x", "y", "z"}) cloud.set(i, axis, kNan);
  }
  const auto scan = read(cloud);
  ASSERT_TRUE(scan);
  EXPECT_NEAR(seconds_between(scan->stamp, kHeader), 10 * Sweep::kColumnS, 1e-8);
}

TEST_F(Reader, AlreadyDeskewedHasNoTimes) {
  sensor_.deskew = "already_done";
  const auto scan = read(velodyne_cloud());
  ASSERT_TRUE(scan);
  EXPECT_FALSE(scan->has_time);
  EXPECT_EQ(scan->duration_s, 0.0);
  EXPECT_EQ(scan->stamp, kHeader);
  EXPECT_EQ(scan->points.size(), 3200U);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("already deskewed"));
}

TEST_F(Reader, TimeOffsetIsAddedHoweverTheStampIsFound) {
  sensor_.lidar_time_offset_s = 0.25;
  EXPECT_NEAR(seconds_between(kHeader, read(velodyne_cloud())->stamp), Sweep::kLastS + 0.25, 1e-8);
  const auto no_time = Sweep::cloud<int>(18, xyz_and({{"ring", 12, kUint16}}));
  EXPECT_NEAR(seconds_between(kHeader, read(no_time)->stamp), 0.1 + 0.25, 1e-8);
  sensor_.deskew = "already_done";
  EXPECT_NEAR(seconds_between(kHeader, read(velodyne_cloud())->stamp), 0.25, 1e-8);
}

// --- what is missing ---

TEST_F(Reader, WithoutRingTheElevationTellsTheBeam) {
  const auto fields = xyz_and({{"intensity", 12, kFloat32}, {"time", 16, kFloat32}});
  expect_sweep(read(Sweep::cloud(20, fields, "time", 0.0, Sweep::kColumnS)), 1e-7);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("ring from the elevation"));
}

TEST_F(Reader, RingsOfAnImpossibleTypeAreNotUsed) {
  const auto fields = xyz_and({{"ring", 12, kFloat32}, {"time", 16, kFloat32}});
  expect_sweep(read(Sweep::cloud(20, fields, "time", 0.0, Sweep::kColumnS)), 1e-7);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("ring from the elevation"));
}

TEST_F(Reader, WithoutRingTheRowsAreBeamsFromTheTop) {
  CloudBytes cloud;
  cloud.point_step = 12;
  cloud.fields = xyz_and({});
  for (int row = 0; row < 16; ++row) {
    for (int column = 0; column < 50; ++column) {
      cloud.add();
      // Flat ground: the elevation would give other beams.
      cloud.set(cloud.size() - 1, "x", 5.0 + row);
      cloud.set(cloud.size() - 1, "y", 0.1 * column - 2.5);
    }
  }
  RawCloud raw = cloud.raw(kHeader);
  raw.width = 50;
  raw.height = 16;
  raw.row_step = 600;
  const auto scan = read(raw);
  ASSERT_TRUE(scan);
  ASSERT_EQ(scan->points.size(), 800U);
  EXPECT_EQ(scan->points.front().ring, 15);
  EXPECT_EQ(scan->points.back().ring, 0);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("ring from the rows"));
}

TEST_F(Reader, WithoutTimeTheAzimuthTellsIt) {
  const auto fields = xyz_and({{"intensity", 12, kFloat32}, {"ring", 16, kUint16}});
  const auto scan = read(Sweep::cloud<int>(18, fields));
  ASSERT_TRUE(scan);
  EXPECT_TRUE(scan->time_from_azimuth);
  EXPECT_TRUE(scan->has_time);
  EXPECT_NEAR(seconds_between(kHeader, scan->stamp), 0.1, 1e-9);
  for (std::size_t i = 0; i < scan->points.size(); ++i) {
    const double column = static_cast<double>(i / 16) + 0.25;
    EXPECT_NEAR(scan->points[i].time_s, column * Sweep::kColumnS - 0.1, 1e-6);
  }
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("time from the azimuth"));
}

TEST_F(Reader, WithoutIntensityItIsZeroAndSaidToBeAbsent) {
  const auto fields = xyz_and({{"ring", 12, kUint16}, {"time", 14, kFloat32}});
  const auto scan = read(Sweep::cloud(18, fields, "time", 0.0, Sweep::kColumnS));
  expect_sweep(scan, 1e-7);
  EXPECT_FALSE(scan->has_intensity);
  EXPECT_EQ(scan->points[17].intensity, 0.0F);
  EXPECT_THAT(notice("cloud_layout"), HasSubstr("intensity absent"));
}

// --- times that are none ---

TEST_F(Reader, EqualTimesAreNoTimes) {
  const auto scan = read(Sweep::cloud(22, velodyne_fields(), "time", 0.0, 0.0));
  ASSERT_TRUE(scan);
  EXPECT_FALSE(scan->has_time);
  EXPECT_EQ(scan->stamp, kHeader);
  EXPECT_THAT(warnings(), HasSubstr("same time"));
}

TEST_F(Reader, TimesOfManyRevolutionsAreNotUsed) {
  PointCloudReader reader(sensor_, &reporter_);
  const auto fields = xyz_and({{"ring", 12, kUint16}, {"t", 16, kUint32}});
  ASSERT_TRUE(reader.read(Sweep::cloud<std::uint32_t>(20, fields, "t", 0, 500000).raw(kHeader)));
  // Forty revolutions: a buffer that the driver did not empty.
  const auto scan = reader.read(Sweep::cloud<std::uint32_t>(20, fields, "t", 0, 20000000).raw(kHeader));
  ASSERT_TRUE(scan);
  EXPECT_TRUE(scan->time_from_azimuth);
  EXPECT_THAT(warnings(), HasSubstr("more than five revolutions"));
  EXPECT_THAT(warnings(), HasSubstr("3.98"));
}

TEST_F(Reader, PointsWithoutAFiniteTimeAreDropped) {
  CloudBytes cloud = velodyne_cloud();
  cloud.set(40, "time", kNan);
  cloud.set(41, "time", std::numeric_limits<float>::infinity());
  const auto scan = read(cloud);
  ASSERT_TRUE(scan);
  EXPECT_EQ(scan->dropped.non_finite, 2U);
  EXPECT_EQ(scan->points.size(), 3198U);
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.set(i, "time", kNan);
  EXPECT_FALSE(read(cloud));
  EXPECT_THAT(warnings(), HasSubstr("3200 not finite in x, y, z or time"));
}

TEST_F(Reader, ReportsTheLayoutOnce) {
  PointCloudReader reader(sensor_, &reporter_);
  const CloudBytes cloud = velodyne_cloud();
  for (int i = 0; i < 12; ++i) ASSERT_TRUE(reader.read(cloud.raw(kHeader + i)));
  EXPECT_EQ(reporter_.notices().at("cloud_layout").count, 1U);
}

}  // namespace
}  // namespace fdi_lio::scan
