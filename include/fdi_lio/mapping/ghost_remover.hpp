#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/keyframe_store.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::mapping {

/// Takes out of keyframe clouds what moved and was not seen to move at the time: points that other keyframes
/// looked through, before and afterwards. The filter of the scans knows the past only, and has to decide at
/// once.
///
/// A point is looked for in the range images of the keyframes 2, 4, 8 and 16 before and after its own, and
/// then, unless two of them see it and none looks through it, in all others up to 24. With r its range from
/// there and m = 2 (`dynamic.free_margin` + `dynamic.free_margin_share` r), a keyframe
///   sees it            when it measured a range within m / 2 of r,
///   looks through it   when it measured more than r + m in the three cells about its direction on that ring,
///                      and in all of the nine about it, or with a beam that passes within 10 cm of it.
/// Beside sparse rings the nine hold the ground before it, hence the beam. Over ground each beam passes: a
/// falling one that passes above the point by a must have gone farther than a level surface through the point
/// lets it, r + a / (f - 0.01) + m with f, what it falls by in a metre. A point goes when at least two look
/// through it, and more than twice as many as see it.
class GhostRemover {
 public:
  GhostRemover(const scan::DynamicConfig& config, const Eigen::Isometry3d& T_imu_lidar);

  /// Adds the next keyframe; without an image it is no witness. `is_apart`: no way leads to it from the one
  /// before, so that neither says anything about the other.
  void add(const Eigen::Isometry3d& T_odom_imu, std::shared_ptr<const scan::RangeImage> image, bool is_apart);

  /// A keyframe that has all its witnesses and was not cleaned, counted from 0; with `is_last` any that was
  /// not cleaned.
  std::optional<std::size_t> next(bool is_last);

  /// Keyframes that `next` gave: those before this one.
  std::size_t given() const { return next_; }

  /// The cloud of a keyframe that `next` gave, without what was looked through; nothing when all of it stays.
  std::optional<KeyframeCloud> clean(std::size_t keyframe, const KeyframeCloud& cloud) const;

 private:
  struct View {
    Eigen::Isometry3d T_odom_lidar;
    std::shared_ptr<const scan::RangeImage> image;
    std::size_t stretch;  ///< of keyframes that ways lead between
  };

  struct Witness {
    const scan::RangeImage* image;
    Eigen::Isometry3f T_lidar_imu;  ///< from the IMU frame of the keyframe in question
    Eigen::Vector3f up;             ///< unit vector in its lidar's frame

    /// Whether nothing was where it looked towards the point k of `seen`.
    bool looks_through(const scan::RangeImage::Directions& seen, int k, float margin_m) const;
  };
  using Rounds = std::array<std::vector<Witness>, 2>;  ///< in the order in which they are asked
  struct Votes {
    int free = 0;
    int there = 0;
  };

  std::vector<Witness> witnesses(std::size_t keyframe, const std::vector<std::size_t>& steps) const;
  /// Adds the votes on the points `chosen`.
  void ask(const std::vector<Witness>& witnesses, const std::vector<Point>& points,
           const std::vector<std::uint32_t>& chosen, std::vector<Votes>* votes) const;
  std::vector<Point> kept(const std::vector<Point>& points, const Rounds& rounds) const;

  scan::DynamicConfig config_;
  Eigen::Isometry3d T_imu_lidar_;
  std::deque<View> views_;
  std::size_t first_ = 0;  ///< number of the first of `views_`
  std::size_t next_ = 0;   ///< the first that was not cleaned
};

}  // namespace fdi_lio::mapping
