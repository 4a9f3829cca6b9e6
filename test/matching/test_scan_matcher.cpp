#include <algorithm>
#include <iterator>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/matching/mean_radius.hpp"
#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::matching {
namespace {

/// A room of three orthogonal walls, and points on them.
class Room : public testing::Test {
 protected:
  Room() : map_(VoxelMapConfig{}), empty_(VoxelMapConfig{}) {
    std::mt19937 generator(17);
    std::uniform_real_distribution<double> uniform(0.0, 4.0);
    std::normal_distribution<double> normal(0.0, 0.005);
    for (int k = 0; k < 60000; ++k) {
      Eigen::Vector3d p(uniform(generator), uniform(generator), uniform(generator));
      p[k % 3] = 0.2 + normal(generator);
      points_.push_back(p);
    }
    map_.insert(points_, std::vector<float>(points_.size(), 0.0F),
                Eigen::Isometry3d(Eigen::Translation3d(2.0, 2.0, 2.0)));
  }

  /// Every 50th point, seen from the given pose.
  MatchInput seen_from(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) const {
    MatchInput input;
    for (std::size_t k = 0; k < points_.size(); k += 50)
      input.planes.push_back(q.conjugate() * (points_[k] - t));
    return input;
  }

  VoxelMap map_;
  VoxelMap empty_;
  std::vector<Eigen::Vector3d> points_;
};

TEST_F(Room, GaussNewtonFindsTheTruePose) {
  const Eigen::Quaterniond q_true = so3::exp_q(Eigen::Vector3d(0.1, -0.2, 0.5));
  const Eigen::Vector3d t_true(2.0, 1.5, 1.0);
  const MatchInput input = seen_from(q_true, t_true);
  Eigen::Quaterniond q = q_true * so3::exp_q(Eigen::Vector3d(0.01, 0.02, -0.01));
  Eigen::Vector3d t = t_true + Eigen::Vector3d(0.05, -0.08, 0.06);
  const ScanMatcher matcher{Config()};
  for (int iteration = 0; iteration < 10; ++iteration) {
    const LidarInformation information = matcher.linearise(input, map_, empty_, q, t, MatchSettings());
    const Vector6d step = -information.H.ldlt().solve(information.b);
    q = q * so3::exp_q(step.head<3>());
    t += step.tail<3>();
  }
  EXPECT_LT(q.angularDistance(q_true), 5e-4);
  EXPECT_LT((t - t_true).norm(), 2e-3);
}

TEST_F(Room, GradientIsTheNumericDerivativeOfTheCostWhereNoMatchChanges) {
  // A linear kernel is had with a large scale; the cost is then sum r^2 / (2 variance), and b its gradient up
  // to the change of the variance with the pose, which is second order here.
  Config config;
  config.mapping.robust_scale = 100.0;
  config.mapping.correlation_factor = 1.0;
  const ScanMatcher matcher(config);
  MatchInput input;
  input.planes.emplace_back(1.0, 1.0, 0.21);
  const auto at = [&](double dz, double roll) {
    return matcher.linearise(input, map_, empty_, so3::exp_q(Eigen::Vector3d(roll, 0.0, 0.0)),
                             Eigen::Vector3d(0.0, 0.0, dz), MatchSettings());
  };
  const LidarInformation nominal = at(0.0, 0.0);
  ASSERT_EQ(nominal.planes, 1U);
  constexpr double kStep = 1e-4;
  // b is linear in the pose with slope H.
  EXPECT_NEAR((at(kStep, 0.0).b[5] - nominal.b[5]) / kStep, nominal.H(5, 5), 0.02 * nominal.H(5, 5));
  EXPECT_NEAR((at(0.0, kStep).b[5] - nominal.b[5]) / kStep, nominal.H(5, 0), 0.02 * nominal.H(5, 5));
}

TEST_F(Room, ResidualsBeyondTheLimitAreNoMatches) {
  const MatchInput input = seen_from(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  MatchSettings settings;
  settings.max_residual_m = 1e-6;
  const auto information = ScanMatcher(Config()).linearise(
      input, map_, empty_, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), settings);
  EXPECT_LT(information.planes, 5U);
}

TEST_F(Room, APatchThatContradictsThePredictionLosesTrust) {
  MatchInput input = seen_from(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  std::vector<bool> is_moved(input.planes.size(), false);
  for (std::size_t i = 0; i < input.planes.size(); ++i) {
    // A part of the wall across x that is one patch, by 2 cm: as near as any point may well be.
    Eigen::Vector3d& p = input.planes[i];
    if (std::abs(p.x() - 0.2) > 0.05 || (p.tail<2>() - Eigen::Vector2d(1.0, 1.0)).cwiseAbs().maxCoeff() > 1.0)
      continue;
    p.x() += 0.02;
    is_moved[i] = p.tail<2>().minCoeff() > 0.6;  // in the corners the other walls match
  }
  Config config;
  config.mapping.shared_elevation_error_deg = 0.0;
  config.mapping.shared_range_error_m = 0.0;
  config.mapping.beam_elevation_sigma_deg = 1e-4;
  config.mapping.range_bias_m = 0.0;
  const ScanMatcher matcher(config);
  const auto mean_trust = [&](const Matrix6d& covariance) {
    const std::vector<float> trust = matcher.weigh_planes(input, map_, Eigen::Quaterniond::Identity(),
                                                          Eigen::Vector3d::Zero(), covariance);
    Eigen::Vector2d sums = Eigen::Vector2d::Zero();
    Eigen::Vector2d counts = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < trust.size(); ++i) {
      sums[is_moved[i] ? 1 : 0] += trust[i];
      counts[is_moved[i] ? 1 : 0] += 1.0;
    }
    return Eigen::Vector2d(sums.cwiseQuotient(counts));
  };
  const Eigen::Vector2d sure = mean_trust(4e-6 * Matrix6d::Identity());
  EXPECT_GT(sure[0], 0.95);
  EXPECT_LT(sure[1], 0.3);
  // A prediction that may be off by as much says nothing against it.
  const Eigen::Vector2d unsure = mean_trust(0.04 * Matrix6d::Identity());
  EXPECT_GT(unsure[0], 0.95);
  EXPECT_GT(unsure[1], 0.9);
  // The prediction may be off by 2 cm there, by a shift or by a turn about y (the part is 1 m above): s is
  // 4 and 8 cm, and a little more.
  Matrix6d shifted = Matrix6d::Zero();
  shifted(3, 3) = 0.02 * 0.02;
  EXPECT_NEAR(mean_trust(shifted)[1], std::pow(1.0 + std::pow(2.0 / 4.0, 2), -2), 0.05);
  Matrix6d turned = Matrix6d::Zero();
  turned(1, 1) = 0.02 * 0.02;
  EXPECT_NEAR(mean_trust(turned)[1], std::pow(1.0 + std::pow(2.0 / 8.0, 2), -2), 0.05);
}

// Errors of elevation and range that all planes of a wall share, by numeric derivatives of the beams' angles:
// with h_i the information of each alone across the wall and e_i what the errors move it by, together they
// are worth 1 / (1 + sum h_i e_i^2) of the sum of h_i. Of the parts that are smooth from beam to beam, and
// that come from the view, the difference to what they moved the cell by counts.
TEST_F(Room, PlanesThatShareErrorsWeighLess) {
  MatchInput input;
  input.origin = Eigen::Vector3d(0.5, -0.3, 1.2);
  const Eigen::Quaterniond q_imu_lidar = so3::exp_q(Eigen::Vector3d(0.3, -0.2, 0.1));
  input.spin_axis = q_imu_lidar * Eigen::Vector3d::UnitZ();
  const MatchInput all = seen_from(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
  std::copy_if(all.planes.begin(), all.planes.end(), std::back_inserter(input.planes), [](const auto& p) {
    return p.z() < 0.3 && p.template head<2>().minCoeff() > 0.6;  // one wall, clear of its corners
  });
  ASSERT_GT(input.planes.size(), 100U);
  Config config;
  config.mapping.robust_scale = 1e6;
  config.mapping.shared_elevation_error_deg = 0.3;
  config.mapping.shared_range_error_m = 0.01;
  config.mapping.beam_elevation_sigma_deg = 0.2;
  config.mapping.range_bias_m = 0.04;
  const ScanMatcher matcher(config);
  const Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  const Eigen::Vector3d t = Eigen::Vector3d::Zero();

  const auto point_at = [&](double azimuth, double elevation, double range_m) {
    const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                    std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    return Eigen::Vector3d(input.origin + q_imu_lidar * (range_m * direction));
  };
  double shared = 0.0;
  double smooth = 0.0;
  double viewed = 0.0;
  for (const Eigen::Vector3d& p : input.planes) {
    MatchInput single = input;
    single.planes = {p};
    const LidarInformation alone = matcher.linearise(single, map_, empty_, q, t, MatchSettings());
    const Eigen::Vector3d beam = q_imu_lidar.conjugate() * (p - input.origin);
    const double azimuth = std::atan2(beam.y(), beam.x());
    const double elevation = std::atan2(beam.z(), beam.head<2>().norm());
    const double range_m = beam.norm();
    constexpr double kStep = 1e-6;
    const Eigen::Vector3d lever = (point_at(azimuth, elevation + kStep, range_m) - p) / kStep;
    const Eigen::Vector3d direction = (point_at(azimuth, elevation, range_m + kStep) - p) / kStep;
    const Cell* cell = map_.find_plane(p, false);
    ASSERT_NE(cell, nullptr);
    const Eigen::Vector3d n = cell->axes.col(0);
    const double by_smooth = n.dot(lever - cell->lever);
    shared += alone.H(5, 5) *
              (std::pow(0.3 * M_PI / 180.0 * n.dot(lever), 2) + std::pow(0.01 * n.dot(direction), 2));
    smooth += alone.H(5, 5) * std::pow(0.2 * M_PI / 180.0 * by_smooth, 2);
    viewed += alone.H(5, 5) * std::pow(0.04 * n.dot(direction - cell->view), 2);
  }
  ASSERT_GT(shared, 1.0);
  ASSERT_GT(smooth, 1.0);
  ASSERT_GT(viewed, 1.0);
  for (const float factor : matcher.weigh_planes(input, map_, q, t, 1e6 * Matrix6d::Identity()))
    EXPECT_NEAR(factor * (1.0 + shared + smooth + viewed), 1.0, 1e-4);
}

TEST_F(Room, DistrustedPlanesWeighLess) {
  MatchInput input = seen_from(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0, 0.0, 0.02));
  const auto information = [&] {
    return ScanMatcher(Config()).linearise(input, map_, empty_, Eigen::Quaterniond::Identity(),
                                           Eigen::Vector3d::Zero(), MatchSettings());
  };
  const LidarInformation full = information();
  input.plane_factors.assign(input.planes.size(), 0.25F);
  const LidarInformation quarter = information();
  EXPECT_TRUE(quarter.H.isApprox(0.25 * full.H, 1e-9));
  EXPECT_TRUE(quarter.b.isApprox(0.25 * full.b, 1e-9));
}

TEST_F(Room, EmptyInputGivesNoInformation) {
  const auto information = ScanMatcher(Config()).linearise(
      MatchInput(), map_, empty_, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(), MatchSettings());
  EXPECT_EQ(information.planes, 0U);
  EXPECT_TRUE(information.H.isZero());
}

/// Points on the side of an upright pole that `origin` sees.
std::vector<Eigen::Vector3d> near_side(const Eigen::Vector2d& foot, double radius_m,
                                       const Eigen::Vector3d& origin) {
  const Eigen::Vector2d to_sensor = origin.head<2>() - foot;
  const double facing = std::atan2(to_sensor.y(), to_sensor.x());
  std::vector<Eigen::Vector3d> points;
  for (int ring = 0; ring < 8; ++ring) {
    for (int step = -2; step <= 2; ++step) {
      // Evenly across the beams, as a lidar spaces them.
      const double angle = facing + std::asin(0.4 * step);
      points.emplace_back(foot.x() + radius_m * std::cos(angle), foot.y() + radius_m * std::sin(angle),
                          0.05 + 0.15 * ring);
    }
  }
  return points;
}

void append(const std::vector<Eigen::Vector3d>& points, std::vector<Eigen::Vector3d>* all) {
  all->insert(all->end(), points.begin(), points.end());
}

const Eigen::Vector2d kFoot(8.2, 0.2);

/// Map of a pole of 5 cm at kFoot, seen from x = 0.
VoxelMap known_pole() {
  VoxelMap edges(VoxelMapConfig{});
  const auto known = near_side(kFoot, 0.05, Eigen::Vector3d(0.0, 0.2, 0.0));
  edges.insert(known, std::vector<float>(known.size(), 0.0F),
               Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.2, 0.6)));
  return edges;
}

/// Information about the position along x and y that a pole gives, seen from `origin`, when the map has the
/// side of it that is seen from x = 0.
Eigen::Vector2d information_of_pole(double line_radius_m, const Eigen::Vector3d& origin) {
  const VoxelMap edges = known_pole();
  Config config;
  config.sensor.beam_angle_noise_deg = 0.0;
  config.mapping.robust_scale = 1e6;
  config.mapping.line_radius_m = line_radius_m;
  MatchInput input;
  input.edges = {Eigen::Vector3d(kFoot.x(), kFoot.y(), 0.6) - origin};
  const LidarInformation information = ScanMatcher(config).linearise(
      input, VoxelMap(VoxelMapConfig{}), edges, Eigen::Quaterniond::Identity(), origin, MatchSettings());
  EXPECT_EQ(information.edges, 1U);
  return information.H.diagonal().segment<2>(3);
}

TEST(Poles, SeenFromTheSameSideTheirRadiusDoesNotMatter) {
  const Eigen::Vector3d origin(2.0, 0.2, 0.6);
  EXPECT_TRUE(information_of_pole(0.1, origin).isApprox(information_of_pole(0.0, origin), 1e-3));
}

TEST(Poles, SeenFromBehindTheirDepthIsKnownToTwiceTheRadiusAndTheirPlaceAcrossAsBefore) {
  const Eigen::Vector3d origin(14.0, 0.2, 0.6);
  const Eigen::Vector2d thin = information_of_pole(0.0, origin);
  const Eigen::Vector2d thick = information_of_pole(0.1, origin);
  const double weight = MatchSettings().edge_weight / Config().mapping.correlation_factor;
  EXPECT_NEAR(weight / thick.x() - weight / thin.x(), 4.0 * 0.1 * 0.1, 2e-4);
  EXPECT_NEAR(thick.y(), thin.y(), 1e-3 * thin.y());
}

/// A pole of 5 cm that the map knows from x = 0, seen from `origin`.
LidarInformation pole_from(const Eigen::Vector3d& origin, double line_radius_m) {
  const VoxelMap edges = known_pole();
  Config config;
  config.mapping.robust_scale = 1e6;
  MatchInput input;
  append(near_side(kFoot, 0.05, origin), &input.edges);
  for (Eigen::Vector3d& p : input.edges) p -= origin;
  MatchSettings settings;
  settings.line_radius_m = line_radius_m;
  return ScanMatcher(config).linearise(input, VoxelMap(VoxelMapConfig{}), edges,
                                       Eigen::Quaterniond::Identity(), origin, settings);
}

TEST(Poles, SeenFromBehindTheyLieOffByTwiceTheirRadius) {
  const Eigen::Vector3d origin(14.0, 0.2, 0.6);
  // The mean of the near side's points is nearer than the axis by 0.807 of the radius (`near_side`).
  const auto pull_m = [&](double line_radius_m) {
    const LidarInformation information = pole_from(origin, line_radius_m);
    return information.b[3] / information.H(3, 3);
  };
  EXPECT_NEAR(pull_m(0.0), 2.0 * 0.807 * 0.05, 2e-3);
  EXPECT_NEAR(pull_m(0.807 * 0.05), 0.0, 2e-3);
}

TEST(Poles, SeenFromTheSideTellOfTheirRadiusWithItsDerivative) {
  // Half a radian round the pole, against differences of the normal equations.
  const Eigen::Vector3d origin(8.2 - 8.0 * std::cos(0.5), 0.2 - 8.0 * std::sin(0.5), 0.6);
  const double step_m = 1e-3;
  const LidarInformation at = pole_from(origin, 0.02);
  const LidarInformation more = pole_from(origin, 0.02 + step_m);
  const LidarInformation less = pole_from(origin, 0.02 - step_m);
  EXPECT_TRUE(at.radius.with_pose.isApprox((more.b - less.b) / (2.0 * step_m), 1e-6));
  EXPECT_NEAR(at.radius.information, (more.radius.gradient - less.radius.gradient) / (2.0 * step_m),
              1e-6 * at.radius.information);
  EXPECT_GT(at.radius.information, 0.0);
}

TEST(Poles, SeenFromBehindTellNothingOfTheirRadius) {
  // Only what is turned by less than 0.5 counts: along the beam nothing, across it nothing is turned.
  const LidarInformation information = pole_from({14.0, 0.2, 0.6}, 0.0);
  EXPECT_LT(std::abs(information.radius.with_pose[3]), 1e-3 * information.H(3, 3));
}

/// Way that the lidar alone measures along 120 m of a road without anything but ground and poles, over the
/// true one. `mean_radius_sigma_m`: deviation of the poles' mean radius before any is seen; 0: it is zero.
double measured_way(double line_radius_m, double mean_radius_sigma_m) {
  std::mt19937 generator(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::normal_distribution<double> noise(0.0, 0.01);
  std::vector<Eigen::Vector2d> feet;
  for (double x = -40.0; x < 170.0; x += 7.0) {
    for (const double side : {-6.0, 6.0}) feet.emplace_back(x + 3.0 * uniform(generator), side);
  }
  Config config;
  config.mapping.line_radius_m = line_radius_m;
  const ScanMatcher matcher(config);
  MeanRadius radius(mean_radius_sigma_m);
  MatchSettings settings;
  VoxelMap planes(VoxelMapConfig{});
  VoxelMap edges(VoxelMapConfig{});
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d t(0.0, 0.0, 1.7);
  for (int k = 0; k < 120; ++k) {
    const Eigen::Vector3d t_true(k, 0.0, 1.7);
    MatchInput input;
    for (int i = 0; i < 1500; ++i) {
      input.planes.emplace_back(20.0 * uniform(generator), 8.0 * uniform(generator), noise(generator) - 1.7);
    }
    for (const Eigen::Vector2d& foot : feet) {
      if (std::abs(foot.x() - t_true.x()) < 30.0) append(near_side(foot, 0.06, t_true), &input.edges);
    }
    if (k > 0) t.x() += 1.0;
    for (Eigen::Vector3d& p : input.edges) {
      p = p - t_true + Eigen::Vector3d(noise(generator), noise(generator), noise(generator));
    }
    RadiusEvidence evidence;
    settings.line_radius_m = radius.mean_m();
    for (int iteration = 0; iteration < 5 && k > 0; ++iteration) {
      LidarInformation information = matcher.linearise(input, planes, edges, q, t, settings);
      evidence = radius.eliminate(&information);
      const Vector6d step = -information.H.ldlt().solve(information.b);
      q = q * so3::exp_q(step.head<3>());
      t += step.tail<3>();
    }
    radius.learn(evidence);
    const auto insert = [&](const std::vector<Eigen::Vector3d>& points, VoxelMap* map) {
      std::vector<Eigen::Vector3d> placed;
      for (const Eigen::Vector3d& p : points) placed.push_back(q * p + t);
      map->insert(placed, std::vector<float>(placed.size(), 0.0F),
                  Eigen::Isometry3d(Eigen::Translation3d(t)));
    };
    insert(input.planes, &planes);
    insert(input.edges, &edges);
  }
  return t.x() / 119.0;
}

TEST(Poles, ShortenTheWayPastThemLess) {
  const double sigma_m = Config().mapping.line_radius_m;
  const double without = 1.0 - measured_way(0.0, 0.0);
  const double weighed = 1.0 - measured_way(sigma_m, 0.0);
  const double learned = 1.0 - measured_way(sigma_m, sigma_m);
  EXPECT_GT(without, 0.001) << "this test's road shows nothing";
  EXPECT_LT(std::abs(weighed), 0.5 * without);
  EXPECT_LT(std::abs(learned), 0.8 * std::abs(weighed)) << without << ", " << weighed << ", " << learned;
}

}  // namespace
}  // namespace fdi_lio::matching
