#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "fdi_lio/mapping/ghost_remover.hpp"

namespace fdi_lio::mapping {
namespace {

/// Sixteen beams; `range_of` gives the range in a direction.
template <typename Range>
DeskewedScan cast(int columns, double spacing_rad, const Range& range_of) {
  DeskewedScan scan;
  scan.ring_begin.push_back(0);
  for (int ring = 0; ring < 16; ++ring) {
    const double elevation = (ring - 7.5) * spacing_rad;
    for (int column = 0; column < columns; ++column) {
      const double azimuth = M_PI - 2.0 * M_PI * (column + 0.5) / columns;
      const Eigen::Vector3d d(std::cos(elevation) * std::cos(azimuth),
                              std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      Point point;
      point.position = (range_of(d) * d).template cast<float>();
      point.ring = static_cast<std::uint16_t>(ring);
      scan.points.push_back(point);
    }
    scan.ring_begin.push_back(static_cast<std::uint32_t>(scan.points.size()));
  }
  return scan;
}

/// At (x, 0) in a hall that reaches from (-30, -20) to (50, 20) m; with a box 2 m wide whose front is at
/// `box_x_m`, if any.
DeskewedScan scan_from(double x_m, const double* box_x_m) {
  return cast(720, 0.01, [=](const Eigen::Vector3d& d) {
    const double hall_m = std::min((d.x() > 0.0 ? 50.0 - x_m : -30.0 - x_m) / d.x(), 20.0 / std::abs(d.y()));
    if (box_x_m == nullptr || d.x() <= 0.0) return hall_m;
    const double front_m = (*box_x_m - x_m) / d.x();
    return std::abs(front_m * d.y()) < 1.0 ? front_m : hall_m;
  });
}

class Ghosts : public testing::Test {
 protected:
  static constexpr double kStepM = 0.2;
  static constexpr int kKeyframes = 40;

  /// Adds keyframes every 0.2 m; `box` gives where the box is seen from, or no box.
  template <typename Box>
  void drive(const Box& box, int apart_at = -1) {
    for (int k = 0; k < kKeyframes; ++k) {
      const std::optional<double> at = box(k);
      DeskewedScan scan = scan_from(kStepM * k, at ? &*at : nullptr);
      auto image = std::make_shared<scan::RangeImage>();
      image->build(&scan);
      Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
      T.translation().x() = kStepM * k;
      clouds_.push_back({scan.points, {}, {}});
      remover_.add(T, std::move(image), k == apart_at);
      while (const auto next = remover_.next(false)) clean(*next);
    }
    while (const auto next = remover_.next(true)) clean(*next);
  }

  void clean(std::size_t k) {
    EXPECT_EQ(k, cleaned_++);
    if (auto cloud = remover_.clean(k, clouds_[k])) clouds_[k] = *std::move(cloud);
  }

  /// Points of the box that keyframe k still has.
  std::size_t box_points(std::size_t k) const {
    return static_cast<std::size_t>(std::count_if(clouds_[k].surface.begin(), clouds_[k].surface.end(),
                                                  [](const Point& p) { return p.position.norm() < 15.0F; }));
  }
  std::size_t wall_points(std::size_t k) const { return clouds_[k].surface.size() - box_points(k); }

  scan::DynamicConfig config_;
  GhostRemover remover_{config_, Eigen::Isometry3d::Identity()};
  std::vector<KeyframeCloud> clouds_;
  std::size_t cleaned_ = 0;
};

TEST_F(Ghosts, WhatWasThereForOneKeyframeGoesAndTheWallStays) {
  const double place = kStepM * 20 + 10.0;
  drive([&](int k) { return k == 20 ? std::optional<double>(place) : std::nullopt; });
  EXPECT_EQ(cleaned_, static_cast<std::size_t>(kKeyframes));
  const DeskewedScan seen = scan_from(kStepM * 20, &place);
  const auto before = std::count_if(seen.points.begin(), seen.points.end(),
                                    [](const Point& p) { return p.position.norm() < 15.0F; });
  EXPECT_GT(before, 300);
  EXPECT_LT(static_cast<double>(box_points(20)), 0.02 * static_cast<double>(before));
  for (std::size_t k = 0; k < kKeyframes; ++k)
    EXPECT_GT(wall_points(k), seen.points.size() - static_cast<std::size_t>(before) - 1) << k;
}

TEST_F(Ghosts, WhatStandsStillStays) {
  drive([](int) { return std::optional<double>(18.0); });
  for (const std::size_t k : {std::size_t{0}, std::size_t{20}, std::size_t{39}}) {
    const double place = 18.0;
    const DeskewedScan seen = scan_from(kStepM * static_cast<double>(k), &place);
    EXPECT_GT(clouds_[k].surface.size(), 0.99 * static_cast<double>(seen.points.size())) << k;
  }
}

TEST_F(Ghosts, WhatAThirdOfTheKeyframesSeeStays) {
  // Of keyframe 6 eleven others see it, and 19 within reach look through its place later.
  drive([](int k) { return k < 12 ? std::optional<double>(14.0) : std::nullopt; });
  const double place = 14.0;
  const DeskewedScan seen = scan_from(kStepM * 6, &place);
  const auto before = std::count_if(seen.points.begin(), seen.points.end(),
                                    [](const Point& p) { return p.position.norm() < 15.0F; });
  EXPECT_GT(static_cast<double>(box_points(6)), 0.95 * static_cast<double>(before));
}

/// Beams two degrees apart at (x, 0), 0.6 m above the ground of a hall that reaches from (-40, -40) to (60,
/// 40) m; with a post of 0.6 x 0.6 m that is 1.7 m high, on the ground at (`post_x_m`, 0.5), if any.
DeskewedScan scan_above_ground(double x_m, const double* post_x_m) {
  return cast(900, M_PI / 90.0, [=](const Eigen::Vector3d& d) {
    double range_m = std::min((d.x() > 0.0 ? 60.0 - x_m : -40.0 - x_m) / d.x(), 40.0 / std::abs(d.y()));
    if (d.z() < 0.0) range_m = std::min(range_m, -0.6 / d.z());
    if (post_x_m == nullptr || d.x() <= 0.0) return range_m;
    const double front_m = (*post_x_m - 0.3 - x_m) / d.x();
    const bool hits = std::abs(front_m * d.y() - 0.5) < 0.3 && front_m * d.z() < 1.1;
    return hits ? std::min(front_m, range_m) : range_m;
  });
}

TEST(GhostRemover, SparseBeamsThatPassThroughAPlaceTellThatItIsEmpty) {
  // Someone stands before the sensor in one keyframe. Below its legs the next ring always sees the ground
  // before them.
  constexpr int kKeyframes = 49;
  constexpr int kSeen = 24;
  const auto x_m = [](int k) { return 0.2 * k; };
  const double post_x_m = x_m(kSeen) + 6.0;
  GhostRemover remover(scan::DynamicConfig(), Eigen::Isometry3d::Identity());
  std::vector<KeyframeCloud> clouds;
  for (int k = 0; k < kKeyframes; ++k) {
    DeskewedScan scan = scan_above_ground(x_m(k), k == kSeen ? &post_x_m : nullptr);
    auto image = std::make_shared<scan::RangeImage>();
    image->build(&scan);
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = x_m(k);
    clouds.push_back({scan.points, {}, {}});
    remover.add(T, std::move(image), false);
  }
  const auto is_on_post = [](const Point& p) {
    return std::abs(p.position.x() - 5.7F) < 0.01F && std::abs(p.position.y() - 0.5F) < 0.31F;
  };
  while (const auto next = remover.next(true)) {
    const std::vector<Point>& before = clouds[*next].surface;
    const auto cleaned = remover.clean(*next, clouds[*next]);
    const std::vector<Point>& after = cleaned ? cleaned->surface : before;
    const auto on_post_before = std::count_if(before.begin(), before.end(), is_on_post);
    const auto on_post_after = std::count_if(after.begin(), after.end(), is_on_post);
    if (*next == kSeen) {
      EXPECT_GT(on_post_before, 25);
      EXPECT_EQ(on_post_after, 0);
    }
    // The rest is ground and walls.
    EXPECT_GT(static_cast<double>(after.size()) - static_cast<double>(on_post_after),
              0.995 * static_cast<double>(before.size() - static_cast<std::size_t>(on_post_before)))
        << *next;
  }
}

TEST_F(Ghosts, AnotherSessionSaysNothing) {
  // The box is there in the last two keyframes alone; all witnesses but one are of before.
  const auto box = [](int k) { return k >= 38 ? std::optional<double>(17.6) : std::nullopt; };
  drive(box, 38);
  EXPECT_GT(box_points(38), 300U);
  GhostRemover one_session(config_, Eigen::Isometry3d::Identity());
  std::swap(remover_, one_session);
  clouds_.clear();
  cleaned_ = 0;
  drive(box);
  EXPECT_LT(box_points(38), 10U);
}

TEST_F(Ghosts, WithoutImagesAllStays) {
  const DeskewedScan scan = scan_from(0.0, nullptr);
  for (int k = 0; k < 5; ++k) remover_.add(Eigen::Isometry3d::Identity(), nullptr, false);
  EXPECT_EQ(remover_.next(false), std::nullopt);
  ASSERT_EQ(remover_.next(true), std::optional<std::size_t>(0));
  EXPECT_FALSE(remover_.clean(0, {scan.points, {}, {}}).has_value());
}

}  // namespace
}  // namespace fdi_lio::mapping
