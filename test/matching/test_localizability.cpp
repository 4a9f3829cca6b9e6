#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/matching/localizability.hpp"

namespace fdi_lio::matching {
namespace {

using Surface = std::function<Eigen::Vector3d(std::mt19937*)>;

double uniform(std::mt19937* generator, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*generator);
}

/// Corridor along x, 3 m wide and 2.5 m high.
Eigen::Vector3d corridor(std::mt19937* generator) {
  const double x = uniform(generator, -12.0, 12.0);
  const double side = uniform(generator, 0.0, 1.0) < 0.5 ? -1.0 : 1.0;
  if (uniform(generator, 0.0, 1.0) < 0.5) return {x, 1.5 * side, uniform(generator, -1.25, 1.25)};
  return {x, uniform(generator, -1.5, 1.5), 1.25 * side};
}

Eigen::Vector3d parallel_planes(std::mt19937* generator) {
  const double side = uniform(generator, 0.0, 1.0) < 0.5 ? -1.0 : 1.0;
  return {uniform(generator, -8.0, 8.0), 3.0 * side, uniform(generator, -4.0, 4.0)};
}

Eigen::Vector3d ground(std::mt19937* generator) {
  return {uniform(generator, -8.0, 8.0), uniform(generator, -8.0, 8.0), -1.7};
}

/// Tube along x of 6 m radius.
Eigen::Vector3d cylinder(std::mt19937* generator) {
  const double angle = uniform(generator, -M_PI, M_PI);
  return {uniform(generator, -12.0, 12.0), 6.0 * std::cos(angle), 6.0 * std::sin(angle)};
}

Eigen::Vector3d sphere(std::mt19937* generator) {
  std::normal_distribution<double> normal;
  const Eigen::Vector3d direction(normal(*generator), normal(*generator), normal(*generator));
  return 8.0 * direction.normalized();
}

Eigen::Vector3d room(std::mt19937* generator) {
  Eigen::Vector3d p(uniform(generator, -4.0, 4.0), uniform(generator, -4.0, 4.0),
                    uniform(generator, -1.5, 1.5));
  const int axis = static_cast<int>(uniform(generator, 0.0, 3.0));
  p[axis] = (p[axis] < 0.0 ? -1.0 : 1.0) * (axis == 2 ? 1.5 : 4.0);
  return p;
}

struct Sampling {
  std::size_t map_points = 60000;
  std::size_t scan_points = 3000;
  double noise_m = 0.01;
};

constexpr double kMargin = 3.0;  // the default

/// Localizability of the sensor at the place's origin, turned by `yaw` against it.
Localizability at_origin(const Surface& surface, const Sampling& sampling, double yaw_rad) {
  std::mt19937 generator(11);
  std::normal_distribution<double> noise(0.0, sampling.noise_m);
  const Eigen::Quaterniond q = so3::exp_q(Eigen::Vector3d(0.0, 0.0, yaw_rad));
  const auto sample = [&] {
    return Eigen::Vector3d(surface(&generator) +
                           Eigen::Vector3d(noise(generator), noise(generator), noise(generator)));
  };
  std::vector<Eigen::Vector3d> points(sampling.map_points);
  for (Eigen::Vector3d& point : points) point = sample();
  VoxelMap map{VoxelMapConfig()};
  map.insert(points, std::vector<float>(points.size(), 0.0F), Eigen::Isometry3d::Identity());
  MatchInput input;
  for (std::size_t k = 0; k < sampling.scan_points; ++k) input.planes.push_back(q.conjugate() * sample());
  Config config;
  config.sensor.range_noise_m = sampling.noise_m;
  const LidarInformation information = ScanMatcher(config).linearise(
      input, map, VoxelMap(VoxelMapConfig()), q, Eigen::Vector3d::Zero(), MatchSettings());
  return analyse_localizability(information, kMargin);
}

int weak_count(const Localizability& localizability) {
  return static_cast<int>((localizability.probability.array() < 0.5).count());
}

struct Place {
  const char* name;
  Surface surface;
  int weak;
};

class KnownAnswers : public testing::TestWithParam<Sampling> {};

TEST_P(KnownAnswers, NumberOfWeakDirections) {
  const Place places[] = {{"corridor", corridor, 1}, {"parallel planes", parallel_planes, 3},
                          {"ground", ground, 3},     {"cylinder", cylinder, 2},
                          {"sphere", sphere, 3},     {"room", room, 0}};
  for (const Place& place : places) {
    for (const double yaw_rad : {0.0, M_PI / 4.0}) {
      const Localizability found = at_origin(place.surface, GetParam(), yaw_rad);
      EXPECT_EQ(weak_count(found), place.weak)
          << place.name << " at " << yaw_rad << " rad: information " << found.information.transpose()
          << ", noise " << found.noise_information.transpose();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sampled, KnownAnswers,
                         testing::Values(Sampling{}, Sampling{15000, 800, 0.01}, Sampling{60000, 3000, 0.03},
                                         Sampling{20000, 1000, 0.03}));

/// A level floor, 1.8 m below a sensor at rest whose beams are off in range, each by its own error.
std::vector<Eigen::Vector3d> rings_on_floor(std::mt19937* generator, double error_m) {
  constexpr double kHeight = 1.8;
  std::mt19937 of_beams(5);
  std::normal_distribution<double> error(0.0, error_m);
  std::normal_distribution<double> noise(0.0, 0.01);
  std::vector<Eigen::Vector3d> points;
  for (int beam = 0; beam < 64; ++beam) {
    const double elevation = (-8.0 - 0.5 * beam) * M_PI / 180.0;
    const double range = kHeight / std::sin(-elevation) + error(of_beams);
    for (int column = 0; column < 360; ++column) {
      const double azimuth = column * M_PI / 180.0;
      points.push_back((range + noise(*generator)) * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                                                     std::cos(elevation) * std::sin(azimuth),
                                                                     std::sin(elevation)));
    }
  }
  return points;
}

TEST(Localizability, RingsOfBeamsThatAreOffHoldNobodyInPlace) {
  std::mt19937 generator(11);
  VoxelMap map{VoxelMapConfig()};
  for (int scan = 0; scan < 20; ++scan) {
    const auto points = rings_on_floor(&generator, 0.015);
    map.insert(points, std::vector<float>(points.size(), 0.0F), Eigen::Isometry3d::Identity());
  }
  MatchInput input;
  const auto points = rings_on_floor(&generator, 0.015);
  for (std::size_t k = 0; k < points.size(); k += 5) input.planes.push_back(points[k]);
  const auto weak_directions = [&](const Config& config) {
    const LidarInformation information =
        ScanMatcher(config).linearise(input, map, VoxelMap(VoxelMapConfig()), Eigen::Quaterniond::Identity(),
                                      Eigen::Vector3d::Zero(), MatchSettings());
    EXPECT_GT(information.planes, 1000U);
    return weak_count(analyse_localizability(information, 1.0));
  };
  EXPECT_EQ(weak_directions(Config()), 3);
  // To whoever knows of no errors of beams their rings are relief.
  Config sure;
  sure.mapping.range_bias_m = 0.0;
  sure.mapping.beam_elevation_sigma_deg = 1e-4;
  EXPECT_LT(weak_directions(sure), 3);
}

TEST(Localizability, NamesTheAxisOfACorridorAtAnAngle) {
  const double yaw_rad = M_PI / 4.0;
  const Localizability found = at_origin(corridor, Sampling(), yaw_rad);
  const Eigen::Vector3d translation = found.axes.col(5).tail<3>();
  const Eigen::Vector3d axis_imu(std::cos(yaw_rad), -std::sin(yaw_rad), 0.0);
  EXPECT_GT(std::abs(translation.dot(axis_imu)), std::cos(2.0 * M_PI / 180.0));
}

TEST(Localizability, DoesNotDependOnWhereTheSensorStands) {
  // A pure change of the body frame's origin changes centroid and H, but not what is observed.
  std::mt19937 generator(3);
  const auto information_from = [&](const Eigen::Vector3d& origin) {
    generator.seed(3);
    LidarInformation information;
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();
    double square = 0.0;
    constexpr int kCount = 500;
    for (int k = 0; k < kCount; ++k) {
      const Eigen::Vector3d p = corridor(&generator) - origin;
      const Eigen::Vector3d n = Eigen::Vector3d::Unit(k % 3);
      Vector6d jacobian;
      jacobian << p.cross(n), n;
      information.H += jacobian * jacobian.transpose();
      moment += p;
      square += p.squaredNorm();
    }
    information.independent = kCount;
    information.centroid_imu = moment / kCount;
    information.radius_m = std::sqrt(square / kCount - information.centroid_imu.squaredNorm());
    return information;
  };
  const Vector6d here = analyse_localizability(information_from(Eigen::Vector3d::Zero()), 1.0).information;
  const Vector6d there =
      analyse_localizability(information_from(Eigen::Vector3d(40.0, -7.0, 3.0)), 1.0).information;
  EXPECT_LT((here - there).norm(), 1e-6 * here.norm());
}

TEST(Localizability, ProbabilityIsTheStatedEquation) {
  LidarInformation information;
  information.H.diagonal() << 6.0, 5.0, 4.0, 3.0, 2.0, 1.0;
  information.noise_information.diagonal().setConstant(1.5);
  information.independent = 100.0;
  information.radius_m = 1.0;
  const Localizability found = analyse_localizability(information, 2.0);
  for (int k = 0; k < 6; ++k) {
    const double h = 6.0 - k;
    const double e = 3.0;
    const double sd = std::sqrt((2.0 * e * e + 4.0 * h * e) / 100.0);
    EXPECT_NEAR(found.probability[k], 0.5 * (1.0 + std::erf((h - e) / sd / std::sqrt(2.0))), 1e-12);
  }
}

TEST(Localizability, SofteningKeepsTheStepAndLosesItsWeight) {
  std::mt19937 generator(8);
  std::normal_distribution<double> normal;
  Matrix6d A;
  for (int k = 0; k < 36; ++k) A(k) = normal(generator);
  LidarInformation information;
  information.q_odom_imu = so3::exp_q(Eigen::Vector3d(0.3, -0.2, 1.0));
  information.H = A * A.transpose() + Matrix6d::Identity();
  information.b << 1.0, -2.0, 0.5, 0.1, 0.7, -0.3;
  information.noise_information = 0.8 * Matrix6d::Identity();
  information.independent = 2.0;
  information.centroid_imu = Eigen::Vector3d(2.0, 1.0, 0.3);
  information.radius_m = 3.0;
  const Localizability found = analyse_localizability(information, 1.0);
  ASSERT_LT(found.probability.minCoeff(), 0.9);
  ASSERT_GT(found.probability.minCoeff(), 1e-6);
  LidarInformation softened = information;
  soften(found, &softened);
  const Vector6d step = information.H.ldlt().solve(information.b);
  EXPECT_LT((softened.H.ldlt().solve(softened.b) - step).norm(), 1e-6 * step.norm());
  // Its information along each axis is that before times the probability.
  const Localizability after = analyse_localizability(softened, 1.0);
  EXPECT_NEAR(after.information.sum(), found.information.cwiseProduct(found.probability).sum(),
              1e-9 * found.information.sum());
}

TEST(Localizability, WithoutMatchesNothingIsClaimedToBeWeak) {
  EXPECT_EQ(analyse_localizability(LidarInformation(), 1.0).probability, Vector6d::Ones());
}

}  // namespace
}  // namespace fdi_lio::matching
