#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/scan/intensity_model.hpp"

namespace fdi_lio::scan {
namespace {

struct Seen {
  DeskewedScan scan;
  RangeImage image;
};

/// The hall from a place that changes with `k`.
Seen see(const Paint& paint, int k = 0, const SyntheticLidar& lidar = SyntheticLidar()) {
  Seen seen;
  seen.scan =
      cast(lidar, hall(), pose_at(1.0 + 0.05 * k, 2.0, 0.02 * k), to_nanoseconds(100.0 + 0.1 * k), paint)
          .scan;
  seen.image.build(&seen.scan);
  return seen;
}

void scale_intensities(float factor, DeskewedScan* scan) {
  for (Point& point : scan->points) point.intensity *= factor;
}

std::size_t warnings(const Reporter& reporter, const std::string& key) {
  if (!reporter.has(key)) return 0;
  const Notice notice = reporter.notices().at(key);
  EXPECT_EQ(notice.severity, Severity::kWarning);
  return notice.count;
}

TEST(IntensityModel, ScaleOfTheSensorDoesNotMatter) {
  Seen seen = see(marble);
  Reporter reporter;
  IntensityModel model(IntensityConfig(), &reporter);
  const std::vector<float> levels = model.apply(seen.scan, seen.image);
  ASSERT_EQ(levels.size(), seen.scan.points.size());
  for (const float factor : {1.0F / 255.0F, 255.0F, 65535.0F / 255.0F}) {
    Seen scaled = see(marble);
    scale_intensities(factor, &scaled.scan);
    IntensityModel other(IntensityConfig(), &reporter);
    const std::vector<float> same = other.apply(scaled.scan, scaled.image);
    ASSERT_EQ(same.size(), levels.size());
    for (std::size_t i = 0; i < levels.size(); ++i) ASSERT_NEAR(same[i], levels[i], 1e-5) << factor;
  }
  EXPECT_TRUE(reporter.notices().empty());
}

TEST(IntensityModel, LevelIsTheLogarithmOverTheMedian) {
  // Two thirds of the points have the intensity 3: it is the median.
  IntensityConfig config;
  config.beam_gains = false;
  config.range_profile = false;
  int k = 0;
  const Seen seen = see([&k](const Eigen::Vector3d&) { return ++k % 3 == 0 ? 1.0 : 3.0; });
  Reporter reporter;
  const auto levels = IntensityModel(config, &reporter).apply(seen.scan, seen.image);
  for (std::size_t i = 0; i < levels.size(); ++i)
    ASSERT_NEAR(levels[i], std::log1p(seen.scan.points[i].intensity / 3.0), 1e-6);
}

TEST(IntensityModel, RangeExponentUndoesTheFallWithRange) {
  IntensityConfig config;
  config.beam_gains = false;
  config.range_profile = false;
  config.range_exponent = 2.0;
  Seen seen = see(marble);
  std::vector<float> reflectivity;
  for (Point& point : seen.scan.points) {
    reflectivity.push_back(point.intensity);
    point.intensity *= std::pow(10.0F / point.position.norm(), 2.0F);
  }
  Reporter reporter;
  const auto levels = IntensityModel(config, &reporter).apply(seen.scan, seen.image);
  // One scale s for all: exp(J) - 1 = reflectivity / s.
  const float s = reflectivity[0] / std::expm1(levels[0]);
  for (std::size_t i = 0; i < levels.size(); ++i)
    ASSERT_NEAR(std::expm1(levels[i]) * s, reflectivity[i], 1e-3 * reflectivity[i]);
}

TEST(IntensityModel, IncidenceExponentUndoesTheFallWithIncidence) {
  // Lambert's law on a wall 12 m to the left (ring of elevation 0): the cosine is y / r.
  IntensityConfig config;
  config.beam_gains = false;
  config.range_profile = false;
  config.incidence_exponent = 1.0;
  SyntheticLidar lidar;
  lidar.rings = 3;
  lidar.lowest_deg = -1.0;
  lidar.highest_deg = 1.0;
  Seen seen;
  const Box hall_alone{{-60.0, -12.0, -20.0}, {60.0, 12.0, 20.0}};
  seen.scan = cast(lidar, {hall_alone}, Eigen::Isometry3d::Identity(), 0, marble).scan;
  std::vector<float> reflectivity;
  for (Point& point : seen.scan.points) {
    reflectivity.push_back(point.intensity);
    point.intensity *= std::abs(point.position.y()) / point.position.norm();
  }
  seen.image.build(&seen.scan);
  Reporter reporter;
  const auto levels = IntensityModel(config, &reporter).apply(seen.scan, seen.image);
  std::vector<double> scales;
  for (std::size_t i = seen.scan.ring_begin[1] + 1; i + 1 < seen.scan.ring_begin[2]; ++i) {
    const Eigen::Vector3f& p = seen.scan.points[i].position;
    if (std::abs(p.y()) > 11.9F && std::abs(p.x()) < 30.0F)
      scales.push_back(reflectivity[i] / std::expm1(levels[i]));
  }
  ASSERT_GT(scales.size(), 400U);
  const auto [least, greatest] = std::minmax_element(scales.begin(), scales.end());
  EXPECT_LT(*greatest / *least, 1.01);
}

TEST(IntensityModel, FallWithRangeIsLearned) {
  // Photon counts of a grey hall: they fall with the square of the range, and nothing else varies.
  const auto spread = [](bool learns) {
    IntensityConfig config;
    config.beam_gains = false;
    config.range_profile = learns;
    Reporter reporter;
    IntensityModel model(config, &reporter);
    std::vector<float> levels;
    for (int k = 0; k < 5; ++k) {
      Seen seen = see([](const Eigen::Vector3d&) { return 5000.0; }, k);
      for (Point& point : seen.scan.points) point.intensity /= point.position.squaredNorm();
      levels = model.apply(seen.scan, seen.image);
    }
    double mean = 0.0;
    double squares = 0.0;
    for (const float level : levels) mean += level / static_cast<double>(levels.size());
    for (const float level : levels) squares += (level - mean) * (level - mean);
    return std::sqrt(squares / static_cast<double>(levels.size()));
  };
  EXPECT_LT(spread(true), 0.25 * spread(false));
}

TEST(IntensityModel, SilentIntensitiesGiveNothingAndOneWarning) {
  struct Case {
    const char* key;
    double intensity;
  };
  for (const Case& each : {Case{"intensity_absent", 0.0}, Case{"intensity_constant", 255.0},
                           Case{"intensity_absent", std::nan("")}}) {
    Reporter reporter;
    IntensityModel model(IntensityConfig(), &reporter);
    std::size_t told = 0;
    for (int k = 0; k < 9; ++k) {
      const Seen seen = see([&each](const Eigen::Vector3d&) { return each.intensity; }, k);
      EXPECT_TRUE(model.apply(seen.scan, seen.image).empty());
      told += reporter.take_new().size();
    }
    EXPECT_EQ(told, 1U) << each.key << " " << each.intensity;
    EXPECT_EQ(warnings(reporter, each.key), 9U);
    EXPECT_EQ(reporter.notices().size(), 1U);
  }
}

TEST(IntensityModel, NothingIsSaidWhereIntensityIsOffOrNotInTheCloud) {
  Reporter reporter;
  IntensityConfig off;
  off.enabled = false;
  Seen seen = see(marble);
  EXPECT_TRUE(IntensityModel(off, &reporter).apply(seen.scan, seen.image).empty());
  seen.scan.has_intensity = false;  // the reader of the cloud reports this
  EXPECT_TRUE(IntensityModel(IntensityConfig(), &reporter).apply(seen.scan, seen.image).empty());
  EXPECT_TRUE(reporter.notices().empty());
  DeskewedScan empty;
  empty.has_intensity = true;
  EXPECT_TRUE(IntensityModel(IntensityConfig(), &reporter).apply(empty, RangeImage()).empty());
}

TEST(IntensityModel, MostlyZeroStillHasAScale) {
  int k = 0;
  const Seen seen = see([&k](const Eigen::Vector3d&) { return ++k % 5 == 0 ? 20.0 + k % 3 : 0.0; });
  Reporter reporter;
  IntensityConfig config;
  config.beam_gains = false;
  const auto levels = IntensityModel(config, &reporter).apply(seen.scan, seen.image);
  ASSERT_EQ(levels.size(), seen.scan.points.size());
  for (std::size_t i = 0; i < levels.size(); ++i)
    ASSERT_NEAR(levels[i], seen.scan.points[i].intensity > 0.0F ? std::log(2.0) : 0.0, 0.06);
}

TEST(IntensityModel, AChangeOfScaleIsReportedAndFollowed) {
  const IntensityConfig config;
  Reporter reporter;
  IntensityModel model(config, &reporter);
  std::vector<float> before;
  for (int k = 0; k < 5; ++k) {
    const Seen seen = see(marble);
    before = model.apply(seen.scan, seen.image);
  }
  EXPECT_EQ(warnings(reporter, "intensity_scale"), 0U);
  const auto distance_to_before = [&](float factor) {
    Seen seen = see(marble);
    scale_intensities(factor, &seen.scan);
    const auto levels = model.apply(seen.scan, seen.image);
    double sum = 0.0;
    for (std::size_t i = 0; i < levels.size(); ++i) sum += std::abs(levels[i] - before[i]);
    return sum / static_cast<double>(levels.size());
  };
  // Odd scans now and then, or a small change, are no change of scale.
  for (int k = 0; k < 2 * config.rescale_scans; ++k) {
    distance_to_before(255.0F);
    EXPECT_LT(distance_to_before(1.0F), 0.05);
  }
  for (int k = 0; k < 2 * config.rescale_scans; ++k) distance_to_before(2.0F);
  EXPECT_EQ(warnings(reporter, "intensity_scale"), 0U);

  for (int k = 0; k < config.rescale_scans; ++k) distance_to_before(255.0F);
  EXPECT_EQ(warnings(reporter, "intensity_scale"), 1U);
  EXPECT_LT(distance_to_before(255.0F), 0.05);
  for (int k = 0; k < 2 * config.rescale_scans; ++k) distance_to_before(255.0F);
  EXPECT_EQ(warnings(reporter, "intensity_scale"), 1U);
}

/// Mean difference of level between neighbouring beams on shared surfaces, without paint: what is left of
/// their gains.
std::vector<double> steps_between_beams(const Seen& seen, const std::vector<float>& levels) {
  std::vector<double> steps;
  for (int ring = 0; ring + 1 < seen.image.rings(); ++ring) {
    double sum = 0.0;
    int count = 0;
    for (int column = 0; column < seen.image.columns(); ++column) {
      const std::uint32_t a = seen.image.at(ring, column);
      const std::uint32_t b = seen.image.at(ring + 1, column);
      if (a == RangeImage::kNone || b == RangeImage::kNone) continue;
      sum += levels[b] - levels[a];
      ++count;
    }
    steps.push_back(sum / count);
  }
  return steps;
}

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

TEST(IntensityModel, UnequalBeamsAreMadeEqual) {
  std::mt19937 generator(31);
  std::normal_distribution<double> normal(0.0, 0.2);
  std::vector<float> factors;
  for (int ring = 0; ring < SyntheticLidar().rings; ++ring)
    factors.push_back(static_cast<float>(std::exp(normal(generator))));
  std::normal_distribution<double> speckle(1.0, 0.1);
  const auto grainy = [&](const Eigen::Vector3d&) { return 40.0 * std::max(0.1, speckle(generator)); };

  IntensityConfig without;
  without.beam_gains = false;
  Reporter reporter;
  IntensityModel plain(without, &reporter);
  IntensityModel model(IntensityConfig(), &reporter);
  double before = 0.0;
  double after = 0.0;
  for (int k = 0; k < 100; ++k) {
    Seen seen = see(grainy, k);
    for (Point& point : seen.scan.points) point.intensity *= factors[point.ring];
    before = rms(steps_between_beams(seen, plain.apply(seen.scan, seen.image)));
    after = rms(steps_between_beams(seen, model.apply(seen.scan, seen.image)));
  }
  RecordProperty("before", std::to_string(before));
  RecordProperty("after", std::to_string(after));
  EXPECT_GT(before, 0.08);
  EXPECT_LT(after, 0.1 * before);
}

TEST(IntensityModel, EqualBeamsStayEqual) {
  Reporter reporter;
  IntensityModel model(IntensityConfig(), &reporter);
  for (int k = 0; k < 60; ++k) {
    const Seen seen = see(marble, k);
    model.apply(seen.scan, seen.image);
  }
  ASSERT_EQ(model.gains().size(), static_cast<std::size_t>(SyntheticLidar().rings));
  for (const float gain : model.gains()) EXPECT_NEAR(gain, 0.0F, 0.1F);
}

}  // namespace
}  // namespace fdi_lio::scan
