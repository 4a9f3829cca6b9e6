#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/matching/localizability.hpp"
#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::matching {
namespace {

const Cell* texture_at(const VoxelMap& map, const Eigen::Vector3d& point) {
  const Cell* cell = nullptr;
  map.find_textures(&point, 1, &cell);
  return cell;
}

using Paint = std::function<double(const Eigen::Vector3d&)>;

VoxelMapConfig texture_config() {
  VoxelMapConfig config;
  config.with_texture = true;
  return config;
}

/// A wall x = 0.2 m that is painted: 4 m x 4 m, measured in several scans.
class Wall {
 public:
  explicit Wall(const Paint& paint, int scans = 10, double intensity_noise = 0.0)
      : planes_(VoxelMapConfig{}), edges_(VoxelMapConfig{}), textures_(texture_config()) {
    std::uniform_real_distribution<double> uniform(0.0, 4.0);
    std::normal_distribution<double> normal(0.0, 1.0);
    for (int scan = 0; scan < scans; ++scan) {
      std::vector<Eigen::Vector3d> points;
      std::vector<float> levels;
      for (int k = 0; k < 1500; ++k) {
        points.emplace_back(0.2 + 0.005 * normal(generator_), uniform(generator_), uniform(generator_));
        levels.push_back(static_cast<float>(paint(points.back()) + intensity_noise * normal(generator_)));
      }
      planes_.insert(points, levels, Eigen::Isometry3d::Identity());
      textures_.insert(points, levels, Eigen::Isometry3d::Identity());
    }
    for (int k = 0; k < 600; ++k) {
      seen_.emplace_back(0.2, 0.5 + 0.75 * uniform(generator_), 0.5 + 0.75 * uniform(generator_));
      levels_.push_back(static_cast<float>(paint(seen_.back())));
    }
  }

  const VoxelMap& planes() const { return planes_; }
  const VoxelMap& edges() const { return edges_; }
  const VoxelMap& textures() const { return textures_; }

  /// Points that are not in the map, as seen from a pose; the lidar is in the IMU.
  MatchInput seen_from(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) const {
    MatchInput input;
    for (const Eigen::Vector3d& p : seen_) input.textures.push_back(q.conjugate() * (p - t));
    input.levels = levels_;
    return input;
  }

  /// Number of 16 x 16 places on the wall that have a texture.
  int textured_places() const {
    int count = 0;
    for (int k = 0; k < 256; ++k) {
      const Eigen::Vector3d p(0.2, 0.1 + 0.25 * (k % 16), 0.1 + 0.25 * (k / 16));
      if (texture_at(textures_, p) != nullptr) ++count;
    }
    return count;
  }

 private:
  std::mt19937 generator_{23};
  VoxelMap planes_;
  VoxelMap edges_;
  VoxelMap textures_;
  std::vector<Eigen::Vector3d> seen_;
  std::vector<float> levels_;
};

const Eigen::Vector3d kRamp(0.0, 1.5, -0.9);

double ramp(const Eigen::Vector3d& p) { return 3.0 + kRamp.dot(p); }
double waves(const Eigen::Vector3d& p) {
  return 1.0 + 0.5 * std::sin(2.0 * p.y()) + 0.4 * std::cos(1.7 * p.z());
}

TEST(Texture, GradientOfARampIsRecovered) {
  const Wall wall(ramp, 10, 0.05);
  int looked_at = 0;
  Eigen::Vector3d mean_gradient = Eigen::Vector3d::Zero();
  for (double y = 0.2; y < 4.0; y += 0.4) {
    for (double z = 0.2; z < 4.0; z += 0.4) {
      const Cell* cell = texture_at(wall.textures(), Eigen::Vector3d(0.2, y, z));
      ASSERT_NE(cell, nullptr);
      ++looked_at;
      mean_gradient += cell->intensity_gradient / 100.0;
      for (int axis = 1; axis < 3; ++axis) {
        const double deviation = std::sqrt(cell->intensity_variance / (cell->count * cell->variances[axis]));
        const double slope = cell->intensity_gradient.dot(cell->axes.col(axis));
        EXPECT_LT(deviation, 0.1);
        // A slope below four of its standard deviations is left at 0; its estimate may be off by four more.
        EXPECT_NEAR(slope, kRamp.dot(cell->axes.col(axis)), (slope == 0.0 ? 8.0 : 4.0) * deviation);
      }
      EXPECT_NEAR(cell->intensity_gradient.dot(cell->axes.col(0)), 0.0, 1e-9);
      EXPECT_NEAR(cell->mean_intensity, ramp(cell->mean), 0.05);
    }
  }
  EXPECT_EQ(looked_at, 100);
  EXPECT_LT((mean_gradient - kRamp).norm(), 0.03 * kRamp.norm());
}

TEST(Texture, ConstantIntensityHasNone) {
  EXPECT_EQ(Wall([](const Eigen::Vector3d&) { return 0.7; }).textured_places(), 0);
}

TEST(Texture, NoiseAloneRarelyPassesForTexture) {
  const Wall wall([](const Eigen::Vector3d&) { return 0.7; }, 10, 0.15);
  EXPECT_LE(wall.textured_places(), 2);
}

TEST(Texture, NeedsThreeInsertions) {
  EXPECT_EQ(Wall(ramp, 2).textured_places(), 0);
  EXPECT_GT(Wall(ramp, 10).textured_places(), 250);
}

TEST(Texture, CellThatIsFullAfterOneScanHasItsTextureAfterThree) {
  VoxelMap map(texture_config());
  std::vector<Eigen::Vector3d> points;
  std::vector<float> levels;
  for (int k = 0; k < 400; ++k) {
    points.emplace_back(0.2, 0.02 * (k % 20) + 0.01, 0.02 * (k / 20 % 20) + 0.01);
    levels.push_back(static_cast<float>(ramp(points.back())));
  }
  const Eigen::Vector3d middle(0.2, 0.2, 0.2);
  for (int scan = 1; scan <= 3; ++scan) {
    EXPECT_EQ(texture_at(map, middle), nullptr) << "before scan " << scan;
    map.insert(points, levels, Eigen::Isometry3d::Identity());
    EXPECT_EQ(map.find_plane(middle, false)->count, VoxelMapConfig().max_points);
  }
  const Cell* cell = texture_at(map, middle);
  ASSERT_NE(cell, nullptr);
  EXPECT_LT((cell->intensity_gradient - kRamp).norm(), 0.05 * kRamp.norm());
}

TEST(Texture, MapWithoutTextureFindsNone) {
  VoxelMap map(VoxelMapConfig{});
  for (int scan = 0; scan < 5; ++scan) {
    std::vector<Eigen::Vector3d> points;
    std::vector<float> levels;
    for (int k = 0; k < 30; ++k) {
      points.emplace_back(0.2, 0.012 * k, 0.05 * (k % 7) + 0.01 * scan);
      levels.push_back(static_cast<float>(k));
    }
    map.insert(points, levels, Eigen::Isometry3d::Identity());
  }
  EXPECT_NE(map.find_plane(Eigen::Vector3d(0.2, 0.2, 0.2), false), nullptr);
  EXPECT_EQ(texture_at(map, Eigen::Vector3d(0.2, 0.2, 0.2)), nullptr);
}

/// With a linear kernel and no shared errors the cost of one residual is r^2 / (2 variance).
Config plain_cost() {
  Config config;
  config.mapping.robust_scale = 1e6;
  config.mapping.correlation_factor = 1.0;
  return config;
}

TEST(Texture, CostHasTheNumericDerivatives) {
  const Wall wall(ramp);
  const ScanMatcher matcher(plain_cost());
  const Eigen::Quaterniond q = so3::exp_q(Eigen::Vector3d(0.2, -0.3, 0.7));
  const Eigen::Vector3d t(-2.0, 1.3, 0.8);
  // From a displaced pose, so that the residuals are not zero.
  const MatchInput all = wall.seen_from(q, t + Eigen::Vector3d(0.01, 0.03, -0.02));
  int compared = 0;
  for (std::size_t i = 0; i < all.textures.size(); i += 20) {
    MatchInput one;
    one.textures = {all.textures[i]};
    one.levels = {all.levels[i]};
    const LidarInformation information =
        matcher.linearise_textures(one, wall.textures(), q, t, MatchSettings());
    const Cell* cell = texture_at(wall.textures(), q * one.textures[0] + t);
    if (cell == nullptr) continue;
    const Eigen::Vector3d from_mean = q * one.textures[0] + t - cell->mean;
    const Eigen::Vector2d reach = (cell->axes.rightCols<2>().transpose() * from_mean)
                                      .cwiseQuotient(cell->variances.tail<2>().cwiseSqrt());
    ASSERT_EQ(information.textures, reach.norm() < std::sqrt(3.0) ? 1U : 0U);
    if (information.textures == 0) continue;
    const auto in_map = [&](const Vector6d& d) {
      return Eigen::Vector3d(q * so3::exp_q(d.head<3>()) * one.textures[0] + t + d.tail<3>());
    };
    const auto along = [&](const Eigen::Vector3d& direction) {
      constexpr double kStep = 1e-5;
      Vector6d derivative;
      for (int k = 0; k < 6; ++k) {
        const Vector6d step = kStep * Vector6d::Unit(k);
        derivative[k] = direction.dot(in_map(step) - in_map(-step)) / (2.0 * kStep);
      }
      return derivative;
    };
    const Vector6d jacobian = along(cell->intensity_gradient);
    const Eigen::Vector3d offset = in_map(Vector6d::Zero()) - cell->mean;
    const double r =
        cell->mean_intensity + cell->intensity_gradient.dot(offset) - static_cast<double>(one.levels[0]);
    const double variance = jacobian.squaredNorm() / information.H.trace();
    EXPECT_LT((information.H - jacobian * jacobian.transpose() / variance).norm(),
              1e-6 * information.H.norm());
    // The mean of J r that the regression's error of the gradient makes.
    Vector6d bias = Vector6d::Zero();
    Matrix6d noise = Matrix6d::Zero();
    for (int axis = 1; axis < 3; ++axis) {
      const Eigen::Vector3d a = cell->axes.col(axis);
      const double slope = cell->intensity_variance / cell->count / cell->variances[axis];
      bias += slope * a.dot(offset) * along(a);
      noise += slope * along(a) * along(a).transpose();
    }
    EXPECT_LT((information.b - r * jacobian / variance).norm(), 1e-6 * information.b.norm());
    EXPECT_LT((information.bias - bias / variance).norm(), 1e-6 * bias.norm() / variance);
    EXPECT_LT((information.noise_information - noise / variance).norm(), 1e-6 * noise.norm() / variance);
    // Spread of the cell, and the point's own position error times the gradient: at least the range noise.
    EXPECT_GT(variance, cell->intensity_variance);
    EXPECT_LT(std::sqrt(variance - cell->intensity_variance), 0.2 * cell->intensity_gradient.norm());
    ++compared;
  }
  EXPECT_GT(compared, 20);
}

TEST(Texture, PaintThatEndsDoesNotPull) {
  // The map knows a cell up to the middle, a ramp. Further on the paint is even, as the next scan sees.
  const auto paint = [](const Eigen::Vector3d& p) { return std::min(p.y(), 1.8) - 1.6; };
  VoxelMap textures(texture_config());
  std::mt19937 generator(4);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.005);
  const auto strip = [&](double begin_m, double end_m, int count) {
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k < count; ++k) {
      points.emplace_back(0.2 + noise(generator), begin_m + (end_m - begin_m) * uniform(generator),
                          1.65 + 0.3 * uniform(generator));
    }
    return points;
  };
  const auto painted = [&](const std::vector<Eigen::Vector3d>& points) {
    std::vector<float> levels;
    for (const Eigen::Vector3d& p : points) levels.push_back(static_cast<float>(paint(p)));
    return levels;
  };
  for (int scan = 0; scan < 4; ++scan) {
    const auto points = strip(1.61, 1.79, 40);
    textures.insert(points, painted(points), Eigen::Isometry3d::Identity());
  }
  MatchInput input;
  input.textures = strip(1.61, 1.99, 400);
  input.levels = painted(input.textures);
  const auto information = ScanMatcher(plain_cost())
                               .linearise_textures(input, textures, Eigen::Quaterniond::Identity(),
                                                   Eigen::Vector3d::Zero(), MatchSettings());
  EXPECT_GT(information.textures, 100U);
  EXPECT_LT(information.textures, 250U);
  EXPECT_LT(std::abs(information.b[4] / information.H(4, 4)), 0.003) << "all points would pull by 4 cm";
}

TEST(Texture, WeightOfIntensityScalesItsInformation) {
  const Wall wall(ramp);
  const ScanMatcher matcher(plain_cost());
  const Eigen::Vector3d t(-2.0, 1.3, 0.8);
  const MatchInput input = wall.seen_from(Eigen::Quaterniond::Identity(), t);
  MatchSettings settings;
  const auto full =
      matcher.linearise_textures(input, wall.textures(), Eigen::Quaterniond::Identity(), t, settings);
  settings.intensity_weight = 0.25;
  const auto part =
      matcher.linearise_textures(input, wall.textures(), Eigen::Quaterniond::Identity(), t, settings);
  EXPECT_LT((part.H - 0.25 * full.H).norm(), 1e-9 * full.H.norm());
}

TEST(Texture, MovesThePoseAlongAWallThatGeometryLeavesFree) {
  const Wall wall(waves, 10, 0.02);
  const ScanMatcher matcher{Config()};
  const Eigen::Quaterniond q_true = so3::exp_q(Eigen::Vector3d(0.1, 0.2, -0.4));
  const Eigen::Vector3d t_true(-2.0, 1.5, 1.2);
  MatchInput input = wall.seen_from(q_true, t_true);
  input.planes = input.textures;

  const Eigen::Vector3d offset(0.02, 0.09, -0.06);
  Eigen::Quaterniond q = q_true * so3::exp_q(Eigen::Vector3d(0.01, -0.008, 0.01));
  Eigen::Vector3d t = t_true + offset;
  const LidarInformation blind = matcher.linearise(input, wall.planes(), wall.edges(), q, t, MatchSettings());
  EXPECT_EQ(blind.textures, 0U);
  EXPECT_LT(blind.H(4, 4), 1e-2 * blind.H(3, 3));

  LidarInformation information;
  for (int iteration = 0; iteration < 15; ++iteration) {
    information = matcher.linearise(input, wall.planes(), wall.edges(), q, t, MatchSettings());
    const Localizability geometric = analyse_localizability(information, 2.0);
    ASSERT_EQ((geometric.probability.array() < 0.5).count(), 3);
    const LidarInformation textures =
        matcher.linearise_textures(input, wall.textures(), q, t, MatchSettings());
    add_in_weak_directions(geometric, textures, &information);
    const Vector6d step = -information.H.ldlt().solve(information.b);
    q = q * so3::exp_q(step.head<3>());
    t += step.tail<3>();
  }
  EXPECT_GT(information.textures, 400U);
  EXPECT_LT(q.angularDistance(q_true), 0.005);
  EXPECT_LT((t - t_true).norm(), 0.1 * offset.norm());
}

}  // namespace
}  // namespace fdi_lio::matching
