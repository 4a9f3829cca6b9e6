#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/common/pose_tangent.hpp"
#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/global_optimizer.hpp"
#include "fdi_lio/mapping/map_level.hpp"

namespace fdi_lio::mapping {
namespace {

using Vector9d = Eigen::Matrix<double, 9, 1>;
using imu::Matrix9d;
using odometry::GravityEstimate;

constexpr double kDegree = M_PI / 180.0;
constexpr double kStepM = 2.0;
constexpr Stamp kStep = 500'000'000;

Config walking(double tilt_deg, double bias) {
  Config config;
  config.mapping.tilt_walk_deg = tilt_deg;
  config.sensor.accel_bias_walk = bias;
  config.sensor.accel_model_walk = 0.0;
  return config;
}

Vector9d walk_variances(const Config& config) {
  Vector9d q = Vector9d::Zero();
  q.head<3>().setConstant(std::pow(config.mapping.tilt_walk_deg * kDegree * config.sensor.gravity_mps2, 2) *
                          kStepM);
  q.segment<3>(3).setConstant(std::pow(config.sensor.accel_bias_walk, 2) * 1e-9 * static_cast<double>(kStep));
  return q;
}

/// What an accelerometer that turns shows of gravity and its bias: g + R b, with noise.
struct Measurements {
  std::vector<Eigen::Matrix<double, 3, 9>> H;
  std::vector<Eigen::Vector3d> z;
};

constexpr double kNoise = 0.05;
const Vector9d kBefore = (Vector9d() << 1.0, 1.0, 1.0, 0.3, 0.3, 0.3, 0.01, 0.01, 0.01).finished();
const Vector9d kMean = (Vector9d() << 0.0, 0.0, -9.81, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0).finished();

Measurements turning(int count, std::mt19937* random) {
  std::normal_distribution<double> normal;
  Measurements all;
  Vector9d truth = kMean;
  truth.segment<3>(3) << 0.2, -0.1, 0.05;
  for (int k = 0; k < count; ++k) {
    truth.x() += 0.02;
    Eigen::Matrix<double, 3, 9> H = Eigen::Matrix<double, 3, 9>::Zero();
    H.leftCols<3>().setIdentity();
    H.middleCols<3>(3) = so3::exp(Eigen::Vector3d(0.0, 0.0, 0.2 * k));
    H.rightCols<3>() = 0.5 * so3::hat(Eigen::Vector3d(0.1 * k, 1.0, -9.81));
    all.H.push_back(H);
    all.z.push_back(H * truth + kNoise * Eigen::Vector3d(normal(*random), normal(*random), normal(*random)));
  }
  return all;
}

/// What is known after each measurement: a Kalman filter.
std::vector<GravityEstimate> filtered(const Measurements& all, const Vector9d& q) {
  std::vector<GravityEstimate> estimates;
  Vector9d x = kMean;
  Matrix9d P = kBefore.cwiseAbs2().asDiagonal();
  for (std::size_t k = 0; k < all.z.size(); ++k) {
    if (k > 0) P += q.asDiagonal();
    const Eigen::Matrix3d S =
        all.H[k] * P * all.H[k].transpose() + kNoise * kNoise * Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, 9, 3> gain = P * all.H[k].transpose() * S.inverse();
    x += gain * (all.z[k] - all.H[k] * x);
    P -= gain * all.H[k] * P;
    estimates.push_back({x, 0.5 * (P + P.transpose())});
  }
  return estimates;
}

/// Gravity at all places by one least squares problem.
std::vector<Eigen::Vector3d> in_one(const Measurements& all, const Vector9d& q) {
  const auto count = static_cast<Eigen::Index>(all.z.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(9 * count, 9 * count);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(9 * count);
  A.topLeftCorner<9, 9>().diagonal() = kBefore.cwiseAbs2().cwiseInverse();
  b.head<9>() = A.topLeftCorner<9, 9>() * kMean;
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto& H = all.H[static_cast<std::size_t>(k)];
    A.block<9, 9>(9 * k, 9 * k) += H.transpose() * H / (kNoise * kNoise);
    b.segment<9>(9 * k) += H.transpose() * all.z[static_cast<std::size_t>(k)] / (kNoise * kNoise);
    if (k == 0) continue;
    const Matrix9d W = q.cwiseMax(1e-14).cwiseInverse().asDiagonal();
    A.block<9, 9>(9 * k, 9 * k) += W;
    A.block<9, 9>(9 * k - 9, 9 * k - 9) += W;
    A.block<9, 9>(9 * k, 9 * k - 9) -= W;
    A.block<9, 9>(9 * k - 9, 9 * k) -= W;
  }
  const Eigen::VectorXd x = A.ldlt().solve(b);
  std::vector<Eigen::Vector3d> gravity;
  for (Eigen::Index k = 0; k < count; ++k) gravity.emplace_back(x.segment<3>(9 * k));
  return gravity;
}

Eigen::Vector3d between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::AngleAxisd turn(Eigen::Quaterniond::FromTwoVectors(from, to));
  return turn.angle() * turn.axis();
}

std::vector<Eigen::Vector3d> tilts_of(const Config& config,
                                      const std::vector<std::optional<GravityEstimate>>& estimates) {
  MapLevel level(config);
  for (std::size_t k = 0; k < estimates.size(); ++k)
    level.add(static_cast<Stamp>(k) * kStep, Eigen::Vector3d(kStepM * static_cast<double>(k), 0.0, 0.0),
              estimates[k]);
  return level.tilts();
}

TEST(MapLevel, IsWhatAllMeasurementsTogetherSay) {
  const Config config = walking(0.05, 0.01);
  std::mt19937 random(3);
  const Measurements all = turning(40, &random);
  const Vector9d q = walk_variances(config);
  const std::vector<GravityEstimate> estimates = filtered(all, q);
  const std::vector<Eigen::Vector3d> gravity = in_one(all, q);
  const auto tilts = tilts_of(config, {estimates.begin(), estimates.end()});
  double filter_is_off = 0.0;
  for (std::size_t k = 0; k < tilts.size(); ++k) {
    const Eigen::Vector3d expected = between(gravity[0], gravity[k]);
    EXPECT_LT((tilts[k] - expected).norm(), 1e-5) << k;
    const Eigen::Vector3d by_filter =
        between(estimates[0].value.head<3>(), Eigen::Vector3d(estimates[k].value.head<3>()));
    filter_is_off = std::max(filter_is_off, (by_filter - expected).norm());
  }
  EXPECT_GT(filter_is_off, 1e-2);  // the first estimates alone would tilt the map
}

TEST(MapLevel, KeyframesThatKnowNothingAreLikeTheirNeighbours) {
  const Config config = walking(0.05, 0.01);
  std::mt19937 random(4);
  const Measurements all = turning(12, &random);
  const std::vector<GravityEstimate> known = filtered(all, walk_variances(config));
  std::vector<std::optional<GravityEstimate>> estimates(known.begin(), known.end());
  estimates[0] = estimates[1] = estimates[5] = estimates[11] = std::nullopt;
  const auto tilts = tilts_of(config, estimates);
  EXPECT_TRUE(tilts[0].isZero() && tilts[1].isZero() && tilts[2].isZero());
  EXPECT_EQ(tilts[5], tilts[6]);
  EXPECT_EQ(tilts[11], tilts[10]);
  EXPECT_GT(tilts[10].norm(), 0.0);
  EXPECT_TRUE(tilts_of(config, {std::nullopt, std::nullopt})[1].isZero());
}

TEST(MapLevel, AnOdometryThatBeganAnewSaysNothingOfTheWayBefore) {
  const Config config = walking(0.05, 0.01);
  std::mt19937 random(5);
  const Vector9d q = walk_variances(config);
  std::vector<GravityEstimate> first = filtered(turning(10, &random), q);
  const std::vector<GravityEstimate> second = filtered(turning(10, &random), q);
  std::vector<std::optional<GravityEstimate>> both(first.begin(), first.end());
  both.insert(both.end(), second.begin(), second.end());
  const auto alone = tilts_of(config, {first.begin(), first.end()});
  const auto tilts = tilts_of(config, both);
  for (std::size_t k = 0; k < alone.size(); ++k) EXPECT_EQ(tilts[k], alone[k]);
}

TEST(MapLevel, AWayThatBendsBecomesStraight) {
  // A map that pitches by a constant rate on the way: circles instead of straight lines.
  constexpr double kRate = 2e-3;  // [rad] a step
  std::vector<Eigen::Isometry3d> poses;
  std::vector<Eigen::Vector3d> tilts;
  const double radius = 1.0 / kRate;
  for (int k = 0; k < 200; ++k) {
    const double angle = kRate * k;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = so3::exp(Eigen::Vector3d(0.0, angle, 0.0));
    T.translation() << radius * std::sin(angle), 0.0, radius * (std::cos(angle) - 1.0);
    poses.push_back(T);
    tilts.emplace_back(0.0, angle, 0.0);
  }
  const auto levelled = levelled_poses(poses, tilts);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Isometry3d& T = levelled[static_cast<std::size_t>(k)];
    EXPECT_LT((T.translation() - Eigen::Vector3d(k, 0.0, 0.0)).norm(), 1e-3) << k;
    EXPECT_LT(so3::log(Eigen::Matrix3d(T.linear())).norm(), 1e-9) << k;
  }
}

/// A straight way of 200 m whose map pitches by 0.04 degrees a step, and gravity shows it.
std::vector<Keyframe> pitching_drive() {
  const Eigen::Quaterniond half = so3::exp_q(Eigen::Vector3d(0.0, -3.5e-4, 0.0));
  const Eigen::Isometry3d step(half * Eigen::Translation3d(2.0, 0.0, 0.0) * half);
  std::vector<Keyframe> drive(100);
  for (std::size_t k = 0; k < drive.size(); ++k) {
    drive[k].stamp = static_cast<Stamp>(k) * kStep;
    drive[k].covariance = isotropic(1e-4, 1e-3);
    if (k > 0) drive[k].T_odom_imu = drive[k - 1].T_odom_imu * step;
    GravityEstimate gravity;
    gravity.value.head<3>() = drive[k].T_odom_imu.linear() * Eigen::Vector3d(0.0, 0.0, -9.81);
    gravity.covariance = 1e-6 * Matrix9d::Identity();
    drive[k].gravity = gravity;
  }
  return drive;
}

struct Saved {
  double height_m = 0.0;           ///< of the last keyframe
  double height_by_steps_m = 0.0;  ///< by the steps of the graph
};

Saved saved(const std::vector<Keyframe>& drive, const Config& config) {
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  for (const Keyframe& keyframe : drive) global.add(keyframe);
  global.optimise();
  global.finish();  // the same again
  const GraphFile graph = global.graph();
  Eigen::Isometry3d T = graph.poses.front();
  for (const RelativePose& step : graph.odometry) T = T * step.T_from_to;
  EXPECT_TRUE(global.T_map_odom().isApprox(graph.poses.back() * drive.back().T_odom_imu.inverse(), 1e-12));
  return {graph.poses.back().translation().z(), T.translation().z()};
}

TEST(MapLevel, LevelsAMapThatNothingElseHasMoved) {
  const std::vector<Keyframe> drive = pitching_drive();
  const double climb_m = drive.back().T_odom_imu.translation().z();
  ASSERT_GT(climb_m, 5.0);
  const Saved level = saved(drive, Config());
  EXPECT_LT(std::abs(level.height_m), 1e-3 * climb_m);
  EXPECT_NEAR(level.height_by_steps_m, level.height_m, 1e-9);
  Config config;
  config.loop.level_map = false;
  EXPECT_NEAR(saved(drive, config).height_m, climb_m, 1e-9);
  config = Config();
  config.loop.enabled = false;
  EXPECT_NEAR(saved(drive, config).height_m, climb_m, 1e-9);
}

/// A straight, level way. At first its keyframes have gravity off by 1 degree, then less and less, as their
/// covariances say.
std::vector<Keyframe> drive_that_finds_gravity() {
  std::vector<Keyframe> drive(100);
  for (std::size_t k = 0; k < drive.size(); ++k) {
    drive[k].stamp = static_cast<Stamp>(k) * kStep;
    drive[k].covariance = isotropic(1e-4, 1e-3);
    drive[k].T_odom_imu.translation().x() = 2.0 * static_cast<double>(k);
    const double off = kDegree * std::exp(-0.05 * static_cast<double>(k));
    GravityEstimate gravity;
    gravity.value.head<3>() << -9.81 * std::sin(off), 0.0, -9.81 * std::cos(off);
    gravity.covariance = std::pow(9.81 * off + 1e-3, 2) * Matrix9d::Identity();
    drive[k].gravity = gravity;
    drive[k].down_imu = gravity.value.head<3>().normalized();
  }
  return drive;
}

// Another odometry has the graph solved.
TEST(MapLevel, AGraphTakesGravityByWhatCameAfterwardsToo) {
  const std::vector<Keyframe> drive = drive_that_finds_gravity();
  Config config;
  config.external_odometry.enabled = true;
  config.loop.gravity_sigma_deg = 0.1;
  Reporter reporter;
  GlobalOptimizer global(config, &reporter);
  for (const Keyframe& keyframe : drive) {
    ExternalPose pose;
    pose.stamp = keyframe.stamp;
    pose.T_world_child = keyframe.T_odom_imu;
    pose.T_world_child.translation() *= 1.01;
    global.add_external(pose);
    global.add(keyframe);
  }
  global.optimise();
  ASSERT_NEAR(global.external_scale(), 1.0 / 1.01, 2e-3);
  double worst_m = 0.0;
  for (const Eigen::Isometry3d& T : global.graph().poses)
    worst_m = std::max(worst_m, std::abs(T.translation().z()));
  EXPECT_LT(worst_m, 0.5);  // by what each knew itself 2.7 m
}

TEST(MapLevel, LeavesSessionsThatNothingTiesTogether) {
  std::vector<Keyframe> drive = pitching_drive();
  drive[50].begins_session = true;
  const double climb_m = drive.back().T_odom_imu.translation().z();
  EXPECT_NEAR(saved(drive, Config()).height_m, climb_m, 1e-9);
}

}  // namespace
}  // namespace fdi_lio::mapping
