#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/scan/gradient_smoother.hpp"

namespace fdi_lio::scan {
namespace {

struct Seen {
  DeskewedScan scan;
  RangeImage image;
};

double grey(const Eigen::Vector3d&) { return 1.0; }

Seen see(const std::vector<Box>& boxes, const Eigen::Isometry3d& T) {
  Seen seen;
  seen.scan = cast(SyntheticLidar(), boxes, T, to_nanoseconds(100.0), grey).scan;
  seen.image.build(&seen.scan);
  return seen;
}

/// Indices of points that are the one of their cell: those with a state of their own.
std::vector<std::size_t> alone_in_cell(const Seen& seen) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < seen.scan.points.size(); ++i) {
    const Point& point = seen.scan.points[i];
    if (seen.image.at(point.ring, point.column) == i) indices.push_back(i);
  }
  return indices;
}

TEST(GradientSmoother, FollowsTheScalarKalmanRecursionOnAStillScene) {
  const GradientConfig config;
  GradientSmoother smoother(config);
  const Seen seen = see(hall(), pose_at(1.0, 2.0, 0.4));
  const std::vector<std::size_t> indices = alone_in_cell(seen);
  ASSERT_GT(indices.size(), 0.95 * seen.scan.points.size());
  // Each point measures an amplitude of its own, in a sequence that is the same for all.
  const auto amplitude = [](std::size_t i) { return 0.1 + 0.01 * static_cast<double>(i % 50); };
  double P = config.measurement_noise;
  double x = 0.0;  // of amplitude 1
  for (int k = 0; k < 8; ++k) {
    const double z = 1.0 + 0.5 * std::sin(2.0 * k);
    std::vector<float> gradients;
    for (std::size_t i = 0; i < seen.scan.points.size(); ++i)
      gradients.push_back(static_cast<float>(amplitude(i) * z));
    const auto stability = smoother.update(seen.scan, seen.image, Eigen::Isometry3d::Identity(), &gradients);
    ASSERT_EQ(stability.size(), seen.scan.points.size());
    double innovation = 0.0;
    if (k == 0) {
      x = z;
    } else {
      P += config.process_noise;
      innovation = z - x;
      const double K = P / (P + config.measurement_noise);
      x += K * innovation;
    }
    for (const std::size_t i : indices) {
      ASSERT_NEAR(gradients[i], amplitude(i) * x, 1e-5) << k;
      const double predicted =
          k == 0 ? 0.0
                 : std::exp(-std::abs(amplitude(i) * innovation) / std::sqrt(P + config.measurement_noise));
      ASSERT_NEAR(stability[i], predicted, 1e-5) << k;
    }
    if (k > 0) P *= 1.0 - P / (P + config.measurement_noise);
  }
  // Where the recursion settles: P'^2 - Q P' - Q R = 0.
  const double Q = config.process_noise;
  const double settled = 0.5 * (Q + std::sqrt(Q * Q + 4.0 * Q * config.measurement_noise));
  EXPECT_NEAR(P + Q, settled, 0.02 * settled);
}

/// Smooths a scene whose gradient is `pattern` at the place in the hall, twice, from two poses; the second
/// time 1 more. Returns by how much the second result exceeds the pattern: 1 where a point starts anew, the
/// Kalman gain where it found its own place again.
std::vector<float> excess_after_motion(const Eigen::Isometry3d& T_first, const Eigen::Isometry3d& T_second,
                                       const std::optional<Eigen::Isometry3d>& T_previous_lidar,
                                       const std::function<double(const Eigen::Vector3d&)>& pattern) {
  GradientSmoother smoother{GradientConfig()};
  const auto gradients_at = [&](const Seen& seen, const Eigen::Isometry3d& T, float more) {
    std::vector<float> gradients;
    for (const Point& point : seen.scan.points)
      gradients.push_back(static_cast<float>(pattern(T * point.position.cast<double>())) + more);
    return gradients;
  };
  const Seen first = see(hall(), T_first);
  std::vector<float> gradients = gradients_at(first, T_first, 0.0F);
  smoother.update(first.scan, first.image, std::nullopt, &gradients);
  const Seen second = see(hall(), T_second);
  gradients = gradients_at(second, T_second, 1.0F);
  smoother.update(second.scan, second.image, T_previous_lidar, &gradients);
  const std::vector<float> truth = gradients_at(second, T_second, 0.0F);
  for (std::size_t i = 0; i < gradients.size(); ++i) gradients[i] -= truth[i];
  return gradients;
}

double share_near(const std::vector<float>& values, double wanted, double tolerance) {
  double count = 0.0;
  for (const float value : values) count += std::abs(value - wanted) < tolerance ? 1.0 : 0.0;
  return count / static_cast<double>(values.size());
}

const GradientConfig kConfig;
const double kSecondGain = (kConfig.measurement_noise + kConfig.process_noise) /
                           (2.0 * kConfig.measurement_noise + kConfig.process_noise);

TEST(GradientSmoother, StateFollowsThePlaceNotTheCell) {
  const Eigen::Isometry3d T_first = pose_at(1.0, 2.0, 0.4);
  const Eigen::Isometry3d T_second = pose_at(1.3, 2.1, 1.4);  // 57 degrees further: other cells
  const auto pattern = [](const Eigen::Vector3d& p) { return 5.0 * std::sin(0.3 * p.x()) + 0.4 * p.y(); };
  const auto compensated = excess_after_motion(T_first, T_second, T_first.inverse() * T_second, pattern);
  EXPECT_GT(share_near(compensated, kSecondGain, 0.15), 0.9);
  const auto by_cell = excess_after_motion(T_first, T_second, Eigen::Isometry3d::Identity(), pattern);
  EXPECT_LT(share_near(by_cell, kSecondGain, 0.15), 0.2);
}

TEST(GradientSmoother, WithoutAMotionAllStartAnew) {
  const auto flat = [](const Eigen::Vector3d&) { return 0.0; };
  const Eigen::Isometry3d T = pose_at(1.0, 2.0, 0.4);
  EXPECT_EQ(share_near(excess_after_motion(T, T, std::nullopt, flat), 1.0, 1e-6), 1.0);
  EXPECT_GT(share_near(excess_after_motion(T, T, Eigen::Isometry3d::Identity(), flat), kSecondGain, 1e-5),
            0.999);
}

TEST(GradientSmoother, ANewSurfaceStartsAnew) {
  GradientSmoother smoother{kConfig};
  const Eigen::Isometry3d T = pose_at(0.0, 0.0, 0.0);
  const Seen before = see(hall(), T);
  std::vector<float> gradients(before.scan.points.size(), 0.2F);
  smoother.update(before.scan, before.image, std::nullopt, &gradients);

  std::vector<Box> boxes = hall();
  boxes.push_back({{9.0, -1.0, 0.05}, {11.0, 1.5, 1.6}, true});
  LabelledScan labelled = cast(SyntheticLidar(), boxes, T, to_nanoseconds(100.1), grey);
  RangeImage image;
  image.build(&labelled.scan);
  gradients.assign(labelled.scan.points.size(), 0.6F);
  const auto stability = smoother.update(labelled.scan, image, Eigen::Isometry3d::Identity(), &gradients);
  std::size_t on_box = 0;
  std::size_t anew = 0;
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    if (!labelled.is_moving[i]) {
      ASSERT_NEAR(gradients[i], 0.2 + kSecondGain * 0.4, 1e-5);
      ASSERT_GT(stability[i], 0.0F);
      continue;
    }
    ++on_box;
    if (gradients[i] == 0.6F && stability[i] == 0.0F) ++anew;
  }
  // Where the box stands on the floor the surfaces meet.
  ASSERT_GT(on_box, 100U);
  EXPECT_GT(static_cast<double>(anew), 0.9 * static_cast<double>(on_box));
}

TEST(GradientSmoother, ResetStartsAnew) {
  GradientSmoother smoother{kConfig};
  const Seen seen = see(hall(), pose_at(0.0, 0.0, 0.0));
  std::vector<float> gradients(seen.scan.points.size(), 0.2F);
  smoother.update(seen.scan, seen.image, std::nullopt, &gradients);
  smoother.reset();
  gradients.assign(seen.scan.points.size(), 0.9F);
  const auto stability = smoother.update(seen.scan, seen.image, Eigen::Isometry3d::Identity(), &gradients);
  EXPECT_EQ(gradients, std::vector<float>(seen.scan.points.size(), 0.9F));
  EXPECT_EQ(stability, std::vector<float>(seen.scan.points.size(), 0.0F));
}

}  // namespace
}  // namespace fdi_lio::scan
