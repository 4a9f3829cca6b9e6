#include <random>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "fdi_lio/matching/voxel_map.hpp"

namespace fdi_lio::matching {
namespace {

std::vector<Eigen::Vector3d> plane_points(std::size_t count, const Eigen::Vector3d& center,
                                          const Eigen::Matrix3d& R, double half_width, double noise) {
  std::mt19937 generator(11);
  std::uniform_real_distribution<double> uniform(-half_width, half_width);
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<Eigen::Vector3d> points;
  for (std::size_t k = 0; k < count; ++k) {
    const double u = uniform(generator);
    const double v = uniform(generator);
    points.push_back(center + R * Eigen::Vector3d(u, v, normal(generator)));
  }
  return points;
}

void insert(const std::vector<Eigen::Vector3d>& points, VoxelMap* map) {
  map->insert(points, std::vector<float>(points.size(), 1.0F), Eigen::Isometry3d::Identity());
}

TEST(VoxelMap, PlaneIsThatOfABruteForceFit) {
  const Eigen::Vector3d center(10.2, -3.4, 1.0);  // inside one coarsest cell of 1.6 m
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 2.0, 0.3).normalized()).toRotationMatrix();
  const auto points = plane_points(150, center, R, 0.15, 0.01);
  VoxelMap map(VoxelMapConfig{});
  insert(points, &map);
  const Cell* cell = map.find_plane(center, false);
  ASSERT_NE(cell, nullptr);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::size_t inside = 0;
  for (const auto& p : points) {
    if ((p / 0.4).array().floor().isApprox((center / 0.4).array().floor())) {
      mean += p;
      ++inside;
    }
  }
  mean /= static_cast<double>(inside);
  EXPECT_EQ(cell->count, inside);
  EXPECT_LT((cell->mean - mean).norm(), 1e-9);
  EXPECT_GT(std::abs(cell->axes.col(0).dot(R.col(2))), std::cos(0.05));
  EXPECT_NEAR(std::sqrt(cell->variances[0]), 0.01, 0.004);
}

/// What a point moves by, per radian, when its beam rises towards the z axis of a lidar: by the numeric
/// derivative of polar coordinates.
Eigen::Vector3d lever_of(const Eigen::Vector3d& point, const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Vector3d beam = T_map_lidar.inverse() * point;
  const double azimuth = std::atan2(beam.y(), beam.x());
  const auto risen_by = [&](double angle) {
    const double elevation = std::atan2(beam.z(), beam.head<2>().norm()) + angle;
    const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                    std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    return Eigen::Vector3d(T_map_lidar * Eigen::Vector3d(beam.norm() * direction));
  };
  constexpr double kStep = 1e-5;
  return (risen_by(kStep) - risen_by(-kStep)) / (2.0 * kStep);
}

TEST(VoxelMap, ViewAndLeverAreMeansOfWhatTheSensorSaw) {
  const Eigen::Vector3d center(10.2, -3.4, 1.0);
  const auto points = plane_points(40, center, Eigen::Matrix3d::Identity(), 0.1, 0.01);
  VoxelMap map(VoxelMapConfig{});
  Eigen::Vector3d directions = Eigen::Vector3d::Zero();
  Eigen::Vector3d levers = Eigen::Vector3d::Zero();
  const Eigen::AngleAxisd tilt(0.4, Eigen::Vector3d(1.0, 2.0, 0.5).normalized());
  for (const Eigen::Vector3d& origin : {Eigen::Vector3d(4.0, -3.0, 2.0), Eigen::Vector3d(10.0, -9.0, 2.0)}) {
    const Eigen::Isometry3d T_map_lidar = Eigen::Translation3d(origin) * tilt;
    map.insert(points, std::vector<float>(points.size(), 1.0F), T_map_lidar);
    for (const Eigen::Vector3d& point : points) {
      directions += (point - origin) / (point - origin).norm();
      levers += lever_of(point, T_map_lidar);
    }
  }
  const Cell* cell = map.find_plane(center, false);
  ASSERT_NE(cell, nullptr);
  ASSERT_EQ(cell->count, 2 * points.size());
  EXPECT_LT((cell->view - directions / cell->count).norm(), 1e-12);
  EXPECT_LT((cell->lever - levers / cell->count).norm(), 1e-7);
}

/// Three rings in one cell, a degree apart: as many beams however often they are seen, and three more
/// from farther away.
TEST(VoxelMap, BeamsAreCountedOnce) {
  VoxelMap map(VoxelMapConfig{});
  const auto insert_rings = [&map](double origin_x) {
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k < 30; ++k) {
      const double elevation = (-17.0 - k % 3) * M_PI / 180.0;
      const double azimuth = 0.002 * k;
      points.emplace_back(4.2 * std::cos(azimuth), 4.2 * std::sin(azimuth), 4.2 * std::tan(elevation));
    }
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(origin_x, 0.0, 0.0));
    map.insert(points, std::vector<float>(points.size(), 1.0F), T_map_lidar);
  };
  const Eigen::Vector3d center(4.2, 0.1, 4.2 * std::tan(-18.0 * M_PI / 180.0));
  insert_rings(0.0);
  ASSERT_NE(map.find_plane(center, false), nullptr);
  EXPECT_EQ(map.find_plane(center, false)->beam_count(), 3.0);
  for (int scan = 0; scan < 5; ++scan) insert_rings(0.0);
  EXPECT_EQ(map.find_plane(center, false)->beam_count(), 3.0);
  insert_rings(-4.0);
  EXPECT_EQ(map.find_plane(center, false)->beam_count(), 6.0);
  EXPECT_EQ(Cell().beam_count(), 1.0);
}

TEST(VoxelMap, SparsePointsAreFoundOnACoarserLevel) {
  VoxelMap map(VoxelMapConfig{});
  std::vector<Eigen::Vector3d> grid;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) grid.emplace_back(0.2 + 0.4 * i, 0.2 + 0.4 * j, 0.5);
  }
  insert(grid, &map);
  const Cell* cell = map.find_plane(Eigen::Vector3d(0.8, 0.8, 0.5), false);
  ASSERT_NE(cell, nullptr);
  EXPECT_EQ(cell->count, 16U);
  EXPECT_NEAR(std::abs(cell->axes(2, 0)), 1.0, 1e-9);
}

TEST(VoxelMap, ALineIsALineAndNoPlane) {
  VoxelMap map(VoxelMapConfig{});
  std::mt19937 generator(5);
  std::normal_distribution<double> normal(0.0, 0.01);
  std::vector<Eigen::Vector3d> pole;
  for (int k = 0; k < 60; ++k) pole.emplace_back(0.8 + normal(generator), 0.8 + normal(generator), 0.025 * k);
  insert(pole, &map);
  EXPECT_EQ(map.find_plane(Eigen::Vector3d(0.8, 0.8, 0.8), false), nullptr);
  const Eigen::Vector3d middle(0.8, 0.8, 0.8);
  const Cell* cell = nullptr;
  map.find_lines(&middle, 1, &cell);
  ASSERT_NE(cell, nullptr);
  EXPECT_GT(std::abs(cell->axes(2, 2)), 0.99);
}

/// Any number of points, with cells and without, one after the other.
TEST(VoxelMap, FindsManyAtOnceAsOneByOne) {
  VoxelMap map(VoxelMapConfig{});
  insert(plane_points(2000, Eigen::Vector3d(0.2, 0.2, 0.2), Eigen::Matrix3d::Identity(), 2.0, 0.01), &map);
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> uniform(-4.0, 4.0);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 1003; ++k)
    points.emplace_back(uniform(generator), uniform(generator), 0.1 * uniform(generator));
  for (const bool wide : {false, true}) {
    const Cell none;
    std::vector<const Cell*> cells(points.size(), &none);
    map.find_planes(points.data(), points.size(), wide, cells.data());
    std::size_t found = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      ASSERT_EQ(cells[k], map.find_plane(points[k], wide)) << "point " << k;
      if (cells[k] != nullptr) ++found;
    }
    EXPECT_GT(found, 100U);
    EXPECT_LT(found, points.size()) << "wide: " << wide;
  }
}

TEST(VoxelMap, StopsAveragingAtTheLimit) {
  VoxelMapConfig config;
  config.max_points = 50;
  VoxelMap map(config);
  insert(plane_points(500, Eigen::Vector3d(0.2, 0.2, 0.2), Eigen::Matrix3d::Identity(), 0.1, 0.01), &map);
  EXPECT_EQ(map.finest_cells().front()->count, 50U);
}

TEST(VoxelMap, ForgetsWhatIsFarAndReusesItsMemory) {
  VoxelMap map(VoxelMapConfig{});
  insert(plane_points(50, Eigen::Vector3d(0.2, 0.2, 0.2), Eigen::Matrix3d::Identity(), 0.1, 0.01), &map);
  const std::size_t before = map.cell_count();
  insert(plane_points(50, Eigen::Vector3d(100.2, 0.2, 0.2), Eigen::Matrix3d::Identity(), 0.1, 0.01), &map);
  map.tidy(Eigen::Vector3d::Zero(), 20.0);
  EXPECT_EQ(map.cell_count(), before);
  EXPECT_EQ(map.find_plane(Eigen::Vector3d(100.2, 0.2, 0.2), false), nullptr);
}

/// A passing object leaves a few points in many cells; walls that were seen before are still there.
TEST(VoxelMap, ForgetsCellsThatWereNeverFilledAndKeepsWalls) {
  VoxelMap map(VoxelMapConfig{});
  insert(plane_points(50, Eigen::Vector3d(0.2, 0.2, 0.2), Eigen::Matrix3d::Identity(), 0.1, 0.01), &map);
  const std::size_t wall = map.cell_count();
  for (int scan = 0; scan < 500; ++scan) {
    const Eigen::Vector3d passing(0.2 + 0.1 * scan, 3.0, 0.2);
    map.insert({passing}, {0.5F}, Eigen::Isometry3d::Identity());
  }
  const std::size_t with_traces = map.cell_count();
  EXPECT_GT(with_traces, wall + 200);
  map.tidy(Eigen::Vector3d::Zero(), 100.0);
  EXPECT_EQ(map.cell_count(), with_traces) << "all were met within 600 insertions";
  for (int scan = 0; scan < 700; ++scan)
    map.insert({Eigen::Vector3d(-5.0, 3.0, 0.2)}, {0.5F}, Eigen::Isometry3d::Identity());
  map.tidy(Eigen::Vector3d::Zero(), 100.0);
  EXPECT_NE(map.find_plane(Eigen::Vector3d(0.2, 0.2, 0.2), false), nullptr);
  // Four points in each of the 125 finest cells are too few; those of 63 middle and 32 coarsest cells are
  // not.
  EXPECT_LE(map.cell_count(), wall + 63 + 32 + 3);
  EXPECT_GE(map.cell_count(), wall + 60 + 30);
}

TEST(VoxelMap, WideSearchFindsTheNeighbouringCell) {
  VoxelMap map(VoxelMapConfig{});
  insert(plane_points(200, Eigen::Vector3d(0.8, 0.8, 0.8), Eigen::Matrix3d::Identity(), 0.7, 0.01), &map);
  const Eigen::Vector3d beside(0.8, 0.8, 1.9);
  EXPECT_EQ(map.find_plane(beside, false), nullptr);
  EXPECT_NE(map.find_plane(beside, true), nullptr);
}

}  // namespace
}  // namespace fdi_lio::matching
