#include <algorithm>
#include <random>
#include <string>

#include "synthetic_scan.hpp"
#include <gtest/gtest.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/scan/dynamic_filter.hpp"
#include "fdi_lio/scan/point_removal.hpp"

namespace fdi_lio::scan {
namespace {

double grey(const Eigen::Vector3d&) { return 1.0; }

constexpr double kLowM = 0.25;

/// Shares of what a filter did to the moving and the static points of some scans.
struct Score {
  std::size_t moving = 0;
  std::size_t moving_removed = 0;
  std::size_t fixed = 0;
  std::size_t fixed_removed = 0;
  std::size_t low = 0;  ///< moving points next to the ground
  std::size_t low_removed = 0;

  double removed() const { return static_cast<double>(moving_removed) / static_cast<double>(moving); }
  double removed_of_low() const { return static_cast<double>(low_removed) / static_cast<double>(low); }
  double kept() const { return 1.0 - static_cast<double>(fixed_removed) / static_cast<double>(fixed); }

  void add(const LabelledScan& labelled, const std::vector<RemovalReason>& reasons,
           const Eigen::Isometry3d& T) {
    for (std::size_t i = 0; i < reasons.size(); ++i) {
      const bool is_removed = reasons[i] != RemovalReason::kNone;
      const double height_m = (T * labelled.scan.points[i].position.cast<double>()).z();
      if (labelled.is_moving[i] && height_m < kLowM) {
        ++low;
        low_removed += is_removed ? 1 : 0;
      }
      (labelled.is_moving[i] ? moving : fixed) += 1;
      if (is_removed) (labelled.is_moving[i] ? moving_removed : fixed_removed) += 1;
    }
  }
};

/// Drives through the hall at `speed` while turning, and past a box that crosses at `box_speed` when that is
/// not 0; scans at 10 Hz for 5 s, the first 1.5 s of which are not scored: there is nothing to compare with.
/// With `is_noisy` ranges deviate by 0.02 m, predicted poses by 0.05 m and 0.3 degrees in each axis, and
/// corrected ones by a fifth of that.
Score drive(DynamicFilter* filter, double speed, double box_speed, bool is_noisy = false) {
  std::mt19937 generator(41);
  std::normal_distribution<double> standard(0.0, 1.0);
  const auto normal = [&] { return is_noisy ? standard(generator) : 0.0; };
  const auto random_vector = [&] { return Eigen::Vector3d(normal(), normal(), normal()); };
  const auto disturbed = [&](const Eigen::Isometry3d& T, double share) {
    Eigen::Isometry3d other = T;
    other.translation() += share * 0.05 * random_vector();
    other.linear() = T.linear() * so3::exp(share * 0.3 * M_PI / 180.0 * random_vector());
    return other;
  };
  Score score;
  const SyntheticLidar lidar;
  for (int k = 0; k < 50; ++k) {
    const double t = 0.1 * k;
    std::vector<Box> boxes = hall();
    if (box_speed != 0.0) {
      const double y = -6.0 + box_speed * t;
      boxes.push_back({{9.0, y, 0.05}, {11.0, y + 1.5, 1.6}, true});
    }
    const Eigen::Isometry3d T = pose_at(-5.0 + speed * t, 0.3 * t, 0.2 * t);
    LabelledScan labelled = cast(lidar, boxes, T, to_nanoseconds(100.0 + t), grey);
    for (Point& point : labelled.scan.points) {
      const double range = point.position.norm();
      point.position *= static_cast<float>(1.0 + 0.02 * normal() / range);
    }
    RangeImage image;
    image.build(&labelled.scan);
    const auto reasons = filter->classify(labelled.scan, image, disturbed(T, 1.0));
    filter->correct_newest(labelled.scan.stamp, disturbed(T, 0.2));
    if (t >= 1.5) score.add(labelled, reasons, T);
  }
  return score;
}

TEST(DynamicFilter, RemovesABoxThatCrossesAndKeepsTheHall) {
  DynamicFilter filter{DynamicConfig()};
  const Score score = drive(&filter, 1.5, 2.0);
  ASSERT_GT(score.moving, 2000U);
  RecordProperty("moving_removed_percent", std::to_string(100.0 * score.removed()));
  RecordProperty("static_kept_percent", std::to_string(100.0 * score.kept()));
  RecordProperty("low_removed_percent", std::to_string(100.0 * score.removed_of_low()));
  EXPECT_GT(score.removed(), 0.93);
  EXPECT_GT(score.removed_of_low(), 0.8);
  EXPECT_GT(score.kept(), 0.99);
}

TEST(DynamicFilter, BearsNoiseAndPredictionErrors) {
  DynamicFilter filter{DynamicConfig()};
  const Score score = drive(&filter, 1.5, 2.0, true);
  RecordProperty("moving_removed_percent", std::to_string(100.0 * score.removed()));
  RecordProperty("static_kept_percent", std::to_string(100.0 * score.kept()));
  EXPECT_GT(score.removed(), 0.92);
  EXPECT_GT(score.kept(), 0.99);
}

TEST(DynamicFilter, RemovesNothingWhereOnlyTheSensorMoves) {
  DynamicFilter filter{DynamicConfig()};
  const Score score = drive(&filter, 1.5, 0.0);
  EXPECT_EQ(score.moving, 0U);
  EXPECT_EQ(score.fixed_removed, 0U);
}

TEST(DynamicFilter, KeepsAParkedBox) {
  DynamicFilter filter{DynamicConfig()};
  Score score = drive(&filter, 1.5, 1e-9);
  EXPECT_GT(score.moving, 2000U);
  EXPECT_EQ(score.moving_removed, 0U);
}

/// Drives through the hall at 2.5 m/s behind a box of this height, 4 m ahead at last and nearer by
/// `closing_mps` than the second before; scored from a scan on.
Score follow(double height_m, int first_scored, double closing_mps = 0.0) {
  DynamicFilter filter{DynamicConfig()};
  Score score;
  for (int k = 0; k < 45; ++k) {
    const double x = -8.0 + 2.5 * 0.1 * k;
    std::vector<Box> boxes = hall();
    const double rear = x + 4.0 + closing_mps * 0.1 * (44 - k);
    boxes.push_back({{rear, -0.8, 0.05}, {rear + 2.0, 0.8, height_m}, true});
    const Eigen::Isometry3d T = pose_at(x, 0.0, 0.0);
    LabelledScan labelled = cast(SyntheticLidar(), boxes, T, to_nanoseconds(100.0 + 0.1 * k), grey);
    RangeImage image;
    image.build(&labelled.scan);
    const auto reasons = filter.classify(labelled.scan, image, T);
    if (k >= first_scored) score.add(labelled, reasons, T);
  }
  return score;
}

TEST(DynamicFilter, AConvoyHidesItsOwnPlaceAndIsFoundAllTheSame) {
  // Earlier scans saw over the box and past it, but its rear stood between them and where it is now. It
  // belongs to what is seen to have moved; the ground does not.
  const Score score = follow(1.2, 30);
  ASSERT_GT(score.moving, 2000U);
  RecordProperty("moving_removed_percent", std::to_string(100.0 * score.removed()));
  EXPECT_GT(score.removed(), 0.9);
  EXPECT_GT(score.kept(), 0.99);
}

TEST(DynamicFilter, ALorryAheadHidesAllOfItsPlaceAndIsFoundAllTheSame) {
  // Higher than the beams reach: no earlier scan saw over it, nor past it. But each saw it where it is to the
  // sensor, at places that are seen through now.
  const Score score = follow(3.9, 15);
  ASSERT_GT(score.moving, 2000U);
  RecordProperty("moving_removed_percent", std::to_string(100.0 * score.removed()));
  EXPECT_GT(score.removed(), 0.9);
  EXPECT_GT(score.kept(), 0.99);
}

/// In all of the scans asked (0.5 s and more ago, 1.25 m of way) it was farther away, or nearer, by 0.4 m and
/// more, which is more than the margin: nothing was found while only what kept its place to the sensor was.
TEST(DynamicFilter, ALorryThatFallsBackOrGetsAwayIsFound) {
  for (const double closing_mps : {1.0, -0.8}) {
    const Score score = follow(3.9, 15, closing_mps);
    ASSERT_GT(score.moving, 2000U);
    EXPECT_GT(score.removed(), 0.9) << closing_mps;
    EXPECT_GT(score.kept(), 0.99) << closing_mps;
  }
}

/// A train whose side slides along itself: for seconds earlier scans saw a surface where it is now, but where
/// two looked through as well they know that it was moving. 64 % are found without that.
TEST(DynamicFilter, WhatMovedIsNoWitnessOfStandingStill) {
  DynamicFilter filter{DynamicConfig()};
  Score score;
  const Eigen::Isometry3d T = pose_at(0.0, 0.0, 0.0);
  for (int k = 0; k < 70; ++k) {
    const double y = -14.0 + 2.0 * 0.1 * k;
    std::vector<Box> boxes = hall();
    boxes.push_back({{6.0, std::max(-9.0, y - 12.0), 0.05}, {7.0, std::max(-8.9, y), 2.0}, true});
    LabelledScan labelled = cast(SyntheticLidar(), boxes, T, to_nanoseconds(100.0 + 0.1 * k), grey);
    RangeImage image;
    image.build(&labelled.scan);
    const auto reasons = filter.classify(labelled.scan, image, T);
    if (k >= 30) score.add(labelled, reasons, T);
  }
  ASSERT_GT(score.moving, 2000U);
  RecordProperty("moving_removed_percent", std::to_string(100.0 * score.removed()));
  EXPECT_GT(score.removed(), 0.7);
  EXPECT_GT(score.kept(), 0.99);
}

TEST(DynamicFilter, ForgetsEarlierScansWithReset) {
  const auto removed_after = [](bool reset) {
    DynamicFilter filter{DynamicConfig()};
    const Eigen::Isometry3d T = pose_at(0.0, 0.0, 0.0);
    const Box appeared{{9.0, -1.0, 0.05}, {11.0, 1.5, 1.6}, true};
    std::size_t removed = 0;
    for (int k = 0; k < 20; ++k) {
      std::vector<Box> boxes = hall();
      if (k == 19) boxes.push_back(appeared);
      if (k == 19 && reset) filter.reset();
      LabelledScan labelled = cast(SyntheticLidar(), boxes, T, to_nanoseconds(100.0 + 0.1 * k), grey);
      RangeImage image;
      image.build(&labelled.scan);
      for (const RemovalReason reason : filter.classify(labelled.scan, image, T))
        removed += reason != RemovalReason::kNone ? 1 : 0;
    }
    return removed;
  };
  EXPECT_GT(removed_after(false), 100U);
  EXPECT_EQ(removed_after(true), 0U);
}

TEST(DynamicFilter, PoseOfTheNewestScanIsCorrected) {
  // All predictions but the last are wrong. Corrected, the last scan agrees with the earlier ones; left as
  // predicted, parts of the hall seem to stand where those saw through.
  const auto removed_after = [](bool correct) {
    DynamicFilter filter{DynamicConfig()};
    const Eigen::Isometry3d T = pose_at(-5.0, 0.0, 0.0);
    std::size_t removed = 0;
    for (int k = 0; k < 20; ++k) {
      LabelledScan labelled = cast(SyntheticLidar(), hall(), T, to_nanoseconds(100.0 + 0.1 * k), grey);
      RangeImage image;
      image.build(&labelled.scan);
      const bool is_last = k == 19;
      const Eigen::Isometry3d predicted = is_last ? T : pose_at(-5.0, 1.5, 0.1);
      const auto reasons = filter.classify(labelled.scan, image, predicted);
      if (correct) filter.correct_newest(labelled.scan.stamp, T);
      if (!is_last) continue;
      for (const RemovalReason reason : reasons) removed += reason != RemovalReason::kNone ? 1 : 0;
    }
    return removed;
  };
  EXPECT_EQ(removed_after(true), 0U);
  EXPECT_GT(removed_after(false), 100U);
}

/// A drive that was taken for a stand: when it is found out, the poses before are wrong.
TEST(DynamicFilter, ARevisedPoseMakesTheOnesBeforeForgotten) {
  DynamicFilter filter{DynamicConfig()};
  const auto removed_at = [&](int k, const Eigen::Isometry3d& T_estimated) {
    LabelledScan labelled =
        cast(SyntheticLidar(), hall(), pose_at(0.25 * k, 0.0, 0.0), to_nanoseconds(100.0 + 0.1 * k), grey);
    RangeImage image;
    image.build(&labelled.scan);
    std::size_t removed = 0;
    for (const RemovalReason reason : filter.classify(labelled.scan, image, T_estimated))
      removed += reason != RemovalReason::kNone ? 1 : 0;
    return removed;
  };
  for (int k = 0; k < 15; ++k) removed_at(k, pose_at(0.0, 0.0, 0.0));
  filter.correct_newest(to_nanoseconds(100.0 + 0.1 * 14), pose_at(0.25 * 14, 0.0, 0.0));
  for (int k = 15; k < 20; ++k) EXPECT_EQ(removed_at(k, pose_at(0.25 * k, 0.0, 0.0)), 0U) << k;
}

TEST(DynamicFilter, OffGivesNoReasons) {
  DynamicConfig config;
  config.mode = "off";
  DynamicFilter filter(config);
  LabelledScan labelled = cast(SyntheticLidar(), hall(), pose_at(0.0, 0.0, 0.0), 0, grey);
  RangeImage image;
  image.build(&labelled.scan);
  EXPECT_TRUE(filter.classify(labelled.scan, image, Eigen::Isometry3d::Identity()).empty());
  const std::size_t before = labelled.scan.points.size();
  remove_points({}, &labelled.scan);
  EXPECT_EQ(labelled.scan.points.size(), before);
}

TEST(DynamicFilter, PlainTakesHighGradientAtARangeJumpOnly) {
  DynamicConfig config;
  config.mode = "plain";
  DynamicFilter filter(config);
  std::vector<Box> boxes = hall();
  boxes.push_back({{9.0, -1.0, 0.05}, {11.0, 1.5, 1.6}, true});
  LabelledScan labelled = cast(SyntheticLidar(), boxes, pose_at(0.0, 0.0, 0.0), 0, grey);
  DeskewedScan& scan = labelled.scan;
  RangeImage image;
  image.build(&scan);
  const auto count_removed = [&] {
    const auto reasons = filter.classify(scan, image, Eigen::Isometry3d::Identity());
    EXPECT_EQ(reasons.size(), scan.points.size());
    std::size_t count = 0;
    for (const RemovalReason reason : reasons) {
      if (reason == RemovalReason::kNone) continue;
      EXPECT_EQ(reason, RemovalReason::kCriterion);
      ++count;
    }
    return count;
  };
  EXPECT_EQ(count_removed(), 0U);  // no intensity
  scan.intensity_gradient.assign(scan.points.size(), 0.1F);
  EXPECT_EQ(count_removed(), 0U);  // none stands out

  // One point at the box's silhouette and one in the middle of a wall stand out: the first one goes.
  std::size_t silhouette = 0;
  std::size_t inside = 0;
  for (std::size_t i = 1; i + 1 < scan.points.size(); ++i) {
    const double jump = std::abs(scan.points[i].position.norm() - scan.points[i + 1].position.norm());
    if (scan.points[i].ring == scan.points[i + 1].ring && labelled.is_moving[i] && jump > 3.0) silhouette = i;
    if (labelled.is_moving[i - 1] && labelled.is_moving[i + 1] && scan.points[i].ring == 16) inside = i;
  }
  ASSERT_NE(silhouette, 0U);
  scan.intensity_gradient[silhouette] = 2.0F;
  scan.intensity_gradient[inside] = 2.0F;
  const auto reasons = filter.classify(scan, image, Eigen::Isometry3d::Identity());
  EXPECT_EQ(reasons[silhouette], RemovalReason::kCriterion);
  EXPECT_EQ(count_removed(), 1U);
}

TEST(RemovePoints, KeepsWhatIsKeptPerPointAndTheRings) {
  LabelledScan labelled = cast(SyntheticLidar(), hall(), pose_at(0.0, 0.0, 0.0), 0, grey);
  DeskewedScan& scan = labelled.scan;
  const std::size_t count = scan.points.size();
  std::vector<RemovalReason> reasons(count, RemovalReason::kNone);
  for (std::size_t i = 0; i < count; ++i) {
    // The index marks each point in all arrays.
    scan.points[i].intensity = static_cast<float>(i);
    scan.intensity_level.push_back(static_cast<float>(i));
    scan.intensity_gradient.push_back(static_cast<float>(i) + 0.25F);
    if (i % 7 == 2) reasons[i] = RemovalReason::kFreeSpace;
    if (i % 7 == 3) reasons[i] = RemovalReason::kPartOfObject;
  }
  // All of ring 5 goes: it stays as an empty ring.
  for (std::uint32_t i = scan.ring_begin[5]; i < scan.ring_begin[6]; ++i)
    reasons[i] = RemovalReason::kFreeSpace;
  const auto removed = static_cast<std::size_t>(std::count_if(
      reasons.begin(), reasons.end(), [](RemovalReason r) { return r != RemovalReason::kNone; }));
  const std::size_t rings = scan.ring_count();
  remove_points(reasons, &scan);

  ASSERT_EQ(scan.points.size(), count - removed);
  ASSERT_EQ(scan.intensity_level.size(), scan.points.size());
  ASSERT_EQ(scan.intensity_gradient.size(), scan.points.size());
  EXPECT_TRUE(scan.gradient_stability.empty());
  ASSERT_EQ(scan.removed.size(), removed);
  ASSERT_EQ(scan.removal_reasons.size(), removed);
  ASSERT_EQ(scan.ring_count(), rings);
  EXPECT_EQ(scan.ring_begin.front(), 0U);
  EXPECT_EQ(scan.ring_begin.back(), scan.points.size());
  EXPECT_EQ(scan.ring_begin[5], scan.ring_begin[6]);
  for (std::size_t ring = 0; ring < rings; ++ring) {
    for (std::uint32_t i = scan.ring_begin[ring]; i < scan.ring_begin[ring + 1]; ++i) {
      ASSERT_EQ(scan.points[i].ring, ring);
      const auto before = static_cast<std::size_t>(scan.points[i].intensity);
      ASSERT_EQ(reasons[before], RemovalReason::kNone);
      ASSERT_EQ(scan.intensity_level[i], scan.points[i].intensity);
      ASSERT_EQ(scan.intensity_gradient[i], scan.points[i].intensity + 0.25F);
    }
  }
  for (std::size_t k = 0; k < removed; ++k)
    ASSERT_EQ(scan.removal_reasons[k], reasons[static_cast<std::size_t>(scan.removed[k].intensity)]);
}

}  // namespace
}  // namespace fdi_lio::scan
