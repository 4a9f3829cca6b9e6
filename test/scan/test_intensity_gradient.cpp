#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/scan/intensity_gradient.hpp"

namespace fdi_lio::scan {
namespace {

struct Input {
  DeskewedScan scan;
  RangeImage image;
  std::vector<float> levels;
};

/// The hall seen by a lidar of 32 beams; the levels are the logarithm of the paint.
Input painted_hall(const Paint& paint) {
  Input input;
  input.scan = cast(SyntheticLidar(), hall(), pose_at(1.0, 2.0, 0.4), to_nanoseconds(100.0), paint).scan;
  input.image.build(&input.scan);
  for (const Point& point : input.scan.points) input.levels.push_back(std::log1p(point.intensity / 40.0F));
  return input;
}

/// The same formulas with neighbours among all points, for every 37th point.
class Exact {
 public:
  Exact(const Input& input, const GradientConfig& config) {
    for (std::size_t i = 0; i < input.scan.points.size(); i += 37) {
      std::vector<std::pair<float, float>> by_distance;  // squared distance, difference
      for (std::size_t j = 0; j < input.scan.points.size(); ++j) {
        if (j == i) continue;
        by_distance.emplace_back(
            (input.scan.points[j].position - input.scan.points[i].position).squaredNorm(),
            std::abs(input.levels[j] - input.levels[i]));
      }
      const auto nearest = by_distance.begin() + config.coarse_neighbours;
      std::nth_element(by_distance.begin(), nearest, by_distance.end());
      std::sort(by_distance.begin(), nearest);
      const auto mean_within = [&](double radius, int* count) {
        double sum = 0.0;
        *count = 0;
        for (const auto& [distance_sq, difference] : by_distance) {
          if (distance_sq > radius * radius) continue;
          sum += difference;
          ++*count;
        }
        return *count > 0 ? sum / *count : 0.0;
      };
      const auto mean_of_nearest = [&](int wanted) {
        double sum = 0.0;
        for (int k = 0; k < wanted; ++k) sum += by_distance[k].second;
        return sum / wanted;
      };
      int in_fine = 0;
      int in_coarse = 0;
      const double fine = mean_within(config.fine_radius_m, &in_fine);
      const double coarse = mean_within(config.coarse_radius_m, &in_coarse);
      const bool dense = in_fine >= config.fine_neighbours;
      index.push_back(i);
      is_dense.push_back(dense);
      nearest_gradient.push_back(mean_of_nearest(dense ? config.fine_neighbours : config.coarse_neighbours));
      radius_gradient.push_back(dense ? fine : coarse);
    }
  }

  std::vector<std::size_t> index;
  std::vector<bool> is_dense;
  std::vector<double> nearest_gradient;
  std::vector<double> radius_gradient;
};

/// How close gradients are to exact ones: the median deviation relative to the mean exact gradient, and the
/// correlation.
struct Agreement {
  double median_deviation = 0.0;
  double correlation = 0.0;
  double equal_share = 0.0;  ///< within 1 per cent: the same neighbours
};

Agreement compare(const std::vector<float>& gradients, const std::vector<std::size_t>& index,
                  const std::vector<double>& exact) {
  const auto count = static_cast<double>(index.size());
  double mean_a = 0.0;
  double mean_b = 0.0;
  for (std::size_t k = 0; k < index.size(); ++k) {
    mean_a += gradients[index[k]] / count;
    mean_b += exact[k] / count;
  }
  double aa = 0.0;
  double ab = 0.0;
  double bb = 0.0;
  Agreement agreement;
  std::vector<double> deviations;
  for (std::size_t k = 0; k < index.size(); ++k) {
    const double a = gradients[index[k]];
    const double b = exact[k];
    aa += (a - mean_a) * (a - mean_a);
    ab += (a - mean_a) * (b - mean_b);
    bb += (b - mean_b) * (b - mean_b);
    deviations.push_back(std::abs(a - b) / mean_b);
    if (std::abs(a - b) <= 0.01 * b) agreement.equal_share += 1.0 / count;
  }
  std::nth_element(deviations.begin(), deviations.begin() + deviations.size() / 2, deviations.end());
  agreement.median_deviation = deviations[deviations.size() / 2];
  agreement.correlation = ab / std::sqrt(aa * bb);
  return agreement;
}

void record(const Agreement& agreement) {
  testing::Test::RecordProperty("median_deviation", std::to_string(agreement.median_deviation));
  testing::Test::RecordProperty("correlation", std::to_string(agreement.correlation));
  testing::Test::RecordProperty("equal_share", std::to_string(agreement.equal_share));
}

GradientConfig config_with(const std::string& neighbourhood, double sample_spacing_m) {
  GradientConfig config;
  config.neighbourhood = neighbourhood;
  config.sample_spacing_m = sample_spacing_m;
  return config;
}

/// One scale alone: all points dense, or none.
GradientConfig one_scale(const std::string& neighbourhood, bool fine) {
  GradientConfig config = config_with(neighbourhood, 0.0);
  if (neighbourhood == "radius") {
    config.fine_neighbours = fine ? 0 : 1000000;
  } else {
    config.fine_radius_m = fine ? 1000.0 : 0.0;
  }
  return config;
}

Agreement agreement_of(const GradientConfig& config) {
  const Input input = painted_hall(marble);
  const Exact exact(input, config);
  const auto gradients = IntensityGradient(config).compute(input.scan, input.levels, input.image);
  const Agreement agreement =
      compare(gradients, exact.index,
              config.neighbourhood == "radius" ? exact.radius_gradient : exact.nearest_gradient);
  record(agreement);
  return agreement;
}

// How close the window comes to a search among all points, each scale by itself. They differ where points lie
// denser along a ring than the rings are apart: an exact search stays on the ring there, the window takes the
// rings above and below too. The bounds lie somewhat below the figures measured here (the properties of the
// tests) and keep the agreement from getting worse unnoticed.
TEST(IntensityGradient, FineNearestAreMostlyThoseOfAnExactSearch) {
  const Agreement agreement = agreement_of(one_scale("knn", true));
  EXPECT_GT(agreement.equal_share, 0.5);
  EXPECT_LT(agreement.median_deviation, 0.05);
  EXPECT_GT(agreement.correlation, 0.85);
}

TEST(IntensityGradient, CoarseNearestAreMostlyThoseOfAnExactSearch) {
  const Agreement agreement = agreement_of(one_scale("knn", false));
  EXPECT_GT(agreement.equal_share, 0.5);
  EXPECT_LT(agreement.median_deviation, 0.05);
  EXPECT_GT(agreement.correlation, 0.6);
}

TEST(IntensityGradient, FineRadiusIsNearThatOfAnExactSearch) {
  const Agreement agreement = agreement_of(one_scale("radius", true));
  EXPECT_LT(agreement.median_deviation, 0.2);
  EXPECT_GT(agreement.correlation, 0.6);
}

TEST(IntensityGradient, CoarseRadiusIsNearThatOfAnExactSearch) {
  const Agreement agreement = agreement_of(one_scale("radius", false));
  EXPECT_LT(agreement.median_deviation, 0.2);
  EXPECT_GT(agreement.correlation, 0.6);
}

TEST(IntensityGradient, ScaleIsMostlyThatOfAnExactSearch) {
  const Input input = painted_hall(marble);
  const GradientConfig config = config_with("knn", 0.0);
  const Exact exact(input, config);
  const auto compute = [&](const GradientConfig& each) {
    return IntensityGradient(each).compute(input.scan, input.levels, input.image);
  };
  const auto both = compute(config);
  const auto fine = compute(one_scale("knn", true));
  const auto coarse = compute(one_scale("knn", false));
  std::size_t equal = 0;
  std::size_t exact_only = 0;
  std::size_t window_only = 0;
  for (std::size_t k = 0; k < exact.index.size(); ++k) {
    const std::size_t i = exact.index[k];
    if (fine[i] == coarse[i]) continue;
    const bool is_dense = both[i] == fine[i];
    ASSERT_TRUE(is_dense || both[i] == coarse[i]);
    equal += is_dense == exact.is_dense[k] ? 1 : 0;
    exact_only += !is_dense && exact.is_dense[k] ? 1 : 0;
    window_only += is_dense && !exact.is_dense[k] ? 1 : 0;
  }
  const double share = static_cast<double>(equal) / static_cast<double>(equal + exact_only + window_only);
  RecordProperty("equal_scale_share", std::to_string(share));
  EXPECT_GT(share, 0.7);
  EXPECT_EQ(window_only, 0U);  // the window holds a part of the points
}

/// Squared distances and differences of level of the cells in a window about point i, the nearest first.
std::vector<std::pair<double, double>> window(const Input& input, std::size_t i, int rings, int steps,
                                              int stride) {
  const Point& point = input.scan.points[i];
  std::vector<std::pair<double, double>> found;
  for (int ring = point.ring - rings; ring <= point.ring + rings; ++ring) {
    if (ring < 0 || ring >= input.image.rings()) continue;
    for (int step = -steps; step <= steps; ++step) {
      if (ring == point.ring && step == 0) continue;
      const std::uint32_t j = input.image.at(ring, point.column + step * stride);
      if (j == RangeImage::kNone) continue;
      found.emplace_back((input.scan.points[j].position - point.position).cast<double>().squaredNorm(),
                         std::abs(input.levels[j] - input.levels[i]));
    }
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// The gradient of point i, cell by cell.
double plain_gradient(const Input& input, const GradientConfig& config, std::size_t i) {
  const auto mean_of = [](const std::vector<std::pair<double, double>>& cells, std::size_t count) {
    double sum = 0.0;
    for (std::size_t k = 0; k < count; ++k) sum += cells[k].second;
    return count > 0 ? sum / static_cast<double>(count) : 0.0;
  };
  const auto count_within = [](const std::vector<std::pair<double, double>>& cells, double radius_m) {
    return static_cast<std::size_t>(std::count_if(
        cells.begin(), cells.end(), [&](const auto& cell) { return cell.first <= radius_m * radius_m; }));
  };
  const Point& point = input.scan.points[i];
  const double column_m = 2.0 * M_PI / input.image.columns() * input.image.range_at(point.ring, point.column);
  const int stride = std::clamp(static_cast<int>(config.sample_spacing_m / column_m), 1, 16);
  const auto fine = window(input, i, 1, 2, stride);
  const std::size_t near = count_within(fine, config.fine_radius_m);
  if (near >= static_cast<std::size_t>(config.fine_neighbours))
    return mean_of(fine,
                   config.neighbourhood == "knn" ? static_cast<std::size_t>(config.fine_neighbours) : near);
  const auto coarse = window(input, i, 2, 4, stride);
  if (config.neighbourhood == "radius") return mean_of(coarse, count_within(coarse, config.coarse_radius_m));
  return mean_of(coarse, std::min(coarse.size(), static_cast<std::size_t>(config.coarse_neighbours)));
}

// Points that share a cell, empty cells and many strides. A stride or a radius at its very border may fall to
// either side.
TEST(IntensityGradient, EachPointHasTheMeanOverItsWindow) {
  Input input = painted_hall(marble);
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0.0F, 0.15F);
  for (Point& point : input.scan.points) {
    point.position.x() += noise(random);
    point.position.y() += noise(random);
  }
  input.image.build(&input.scan);
  const std::size_t points = input.scan.points.size();
  std::size_t sharing = 0;
  for (std::size_t i = 0; i < points; ++i)
    sharing += input.image.at(input.scan.points[i].ring, input.scan.points[i].column) != i ? 1 : 0;
  ASSERT_GT(sharing, points / 10);
  for (const char* neighbourhood : {"adaptive", "knn", "radius"}) {
    const GradientConfig config = config_with(neighbourhood, 0.2);
    const auto gradients = IntensityGradient(config).compute(input.scan, input.levels, input.image);
    std::size_t equal = 0;
    for (std::size_t i = 0; i < points; ++i)
      equal += std::abs(gradients[i] - plain_gradient(input, config, i)) <= 1e-5 ? 1 : 0;
    EXPECT_GT(equal, points - points / 1000) << neighbourhood;
  }
}

TEST(IntensityGradient, ConstantWallGivesZero) {
  const Input input = painted_hall([](const Eigen::Vector3d&) { return 17.0; });
  for (const char* neighbourhood : {"adaptive", "knn", "radius"}) {
    const auto gradients =
        IntensityGradient(config_with(neighbourhood, 0.1)).compute(input.scan, input.levels, input.image);
    ASSERT_EQ(gradients.size(), input.scan.points.size());
    EXPECT_EQ(*std::max_element(gradients.begin(), gradients.end()), 0.0F);
  }
}

/// A flat patch of a range image: all points 10 m away, `step_rad` apart along the ring and between rings,
/// the level a function of ring and column.
template <typename Level>
Input patch(double step_rad, const Level& level) {
  constexpr int kRings = 16;
  Input input;
  const int columns = static_cast<int>(std::lround(2.0 * M_PI / step_rad));
  input.scan.ring_begin.push_back(0);
  for (int ring = 0; ring < kRings; ++ring) {
    for (int column = 0; column < columns; ++column) {
      Point point;
      const double azimuth = M_PI - 2.0 * M_PI * (column + 0.5) / columns;
      const double elevation = (ring - 7.5) * step_rad;
      point.position =
          Eigen::Vector3d(10.0 * std::cos(elevation) * std::cos(azimuth),
                          10.0 * std::cos(elevation) * std::sin(azimuth), 10.0 * std::sin(elevation))
              .cast<float>();
      point.ring = static_cast<std::uint16_t>(ring);
      input.scan.points.push_back(point);
      input.levels.push_back(level(ring, column));
    }
    input.scan.ring_begin.push_back(static_cast<std::uint32_t>(input.scan.points.size()));
  }
  input.image.build(&input.scan);
  return input;
}

float gradient_at(const Input& input, const GradientConfig& config, int ring, int column) {
  const auto gradients = IntensityGradient(config).compute(input.scan, input.levels, input.image);
  return gradients[input.scan.ring_begin[ring] + static_cast<std::uint32_t>(column)];
}

TEST(IntensityGradient, StepEdgeGivesTheShareOfNeighboursBeyondItTimesItsHeight) {
  constexpr int kEdge = 200;
  const auto step = [](int, int column) { return column < kEdge ? 0.25F : 1.25F; };
  // 0.1 m apart: all 14 points of the fine window lie within 0.5 m.
  const Input dense = patch(0.01, step);
  const GradientConfig radius = config_with("radius", 0.0);
  EXPECT_NEAR(gradient_at(dense, radius, 8, kEdge - 1), 6.0 / 14.0, 1e-5);
  EXPECT_NEAR(gradient_at(dense, radius, 8, kEdge), 6.0 / 14.0, 1e-5);
  EXPECT_NEAR(gradient_at(dense, radius, 8, kEdge - 2), 3.0 / 14.0, 1e-5);
  EXPECT_EQ(gradient_at(dense, radius, 8, kEdge - 3), 0.0F);
  EXPECT_NEAR(gradient_at(dense, radius, 0, kEdge - 1), 4.0 / 9.0, 1e-5);  // lowest ring: 2 x 5 cells

  // 0.4 m apart: 4 points within 0.5 m are too few, so that the coarse window counts.
  GradientConfig coarse = config_with("radius", 0.0);
  coarse.coarse_radius_m = 0.7;  // the 8 cells around: 3 of them beyond the edge
  const Input sparse = patch(0.04, [](int, int column) { return column < 80 ? 0.25F : 1.25F; });
  EXPECT_NEAR(gradient_at(sparse, coarse, 8, 79), 3.0 / 8.0, 1e-5);
  EXPECT_EQ(gradient_at(sparse, coarse, 8, 78), 0.0F);
}

TEST(IntensityGradient, ScaleFollowsTheDensity) {
  // A stripe every third column: two of four neighbours in the ring differ in the fine window. What the modes
  // choose shows in the values.
  const auto stripes = [](int, int column) { return column % 3 == 0 ? 1.0F : 0.0F; };
  const Input dense = patch(0.01, stripes);
  const Input sparse = patch(0.04, stripes);
  const auto value = [](const Input& input, const char* neighbourhood) {
    return gradient_at(input, config_with(neighbourhood, 0.0), 8, 60);
  };
  EXPECT_EQ(value(dense, "adaptive"), value(dense, "radius"));
  EXPECT_EQ(value(sparse, "adaptive"), value(sparse, "knn"));
  EXPECT_NE(value(sparse, "knn"), value(sparse, "radius"));
}

TEST(IntensityGradient, NearTheSensorEverySthColumnIsTaken) {
  // 0.02 m apart with a spacing of 0.1 m: the window reaches 2 x 5 columns to each side.
  constexpr int kEdge = 1000;
  const Input input = patch(0.002, [](int, int column) { return column < kEdge ? 0.0F : 1.0F; });
  EXPECT_GT(gradient_at(input, config_with("radius", 0.101), 8, kEdge - 10), 0.0F);
  EXPECT_EQ(gradient_at(input, config_with("radius", 0.101), 8, kEdge - 11), 0.0F);
  EXPECT_EQ(gradient_at(input, config_with("radius", 0.0), 8, kEdge - 3), 0.0F);
}

TEST(IntensityGradient, LonePointHasNone) {
  Input input;
  input.scan.ring_begin.assign(17, 0);
  Point point;
  point.position = Eigen::Vector3f(5.0F, 0.0F, 0.0F);
  input.scan.points.push_back(point);
  for (std::size_t ring = 1; ring < input.scan.ring_begin.size(); ++ring) input.scan.ring_begin[ring] = 1;
  input.image.build(&input.scan);
  EXPECT_EQ(IntensityGradient(GradientConfig()).compute(input.scan, {1.0F}, input.image).front(), 0.0F);
}

}  // namespace
}  // namespace fdi_lio::scan
