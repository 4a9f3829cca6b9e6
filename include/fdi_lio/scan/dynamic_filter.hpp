#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/common/time.hpp"
#include "fdi_lio/scan/range_image.hpp"
#include "fdi_lio/scan/scan_config.hpp"

namespace fdi_lio::scan {

/// Finds points on moving objects.
///
/// Mode `plain` is the criterion D(p) = [IDG(p) > mu + kappa sigma] [|dr_p| > eps_r]: both the range jump to
/// the neighbours on the ring and the mean distance to the nearest points of the window exceed
/// lambda eps_r, eps_r = range_jump * range. It also hits the silhouettes of static things.
///
/// Mode `full` asks what earlier scans saw. Each point is looked up in the range images of some earlier
/// scans:
///   free      all of the nine cells about its direction that saw anything saw farther, and at least four
///             did: what is there now was not there then;
///   static    the cell saw a surface at the same place; where two scans say free, one that was not found to
///             move;
///   unknown   neither, as when something nearer hid the place.
/// What drives ahead hides its own place. Where an earlier scan saw something in the direction of an unknown
/// point, about as far away, the point counts as free when the present scan looks through where that was.
/// Free points that touch form an object. It is dropped when it has too few points, or when it touches too
/// many static points (leaves, wires, fences: now seen, now missed); else it takes in the unknown points that
/// touch it, directly or through others, as far as they are no ground, up to six times its size. `odom` has z
/// upwards.
class DynamicFilter {
 public:
  explicit DynamicFilter(const DynamicConfig& config) : config_(config) {}

  /// Whether `classify` looks at the scan's intensity gradient.
  bool needs_gradient() const { return config_.mode == "plain"; }

  /// Reason for the removal of each point of `scan`, in its order. `T_odom_lidar` is the predicted pose.
  std::vector<RemovalReason> classify(const DeskewedScan& scan, const RangeImage& image,
                                      const Eigen::Isometry3d& T_odom_lidar);

  /// Corrects the pose of the newest classified scan once it has been estimated. When that moves it by more
  /// than 2 m, the poses of the scans before do not hold any more either (a start was in motion), and they
  /// are forgotten.
  void correct_newest(Stamp stamp, const Eigen::Isometry3d& T_odom_lidar);

  void reset() { history_.clear(); }

 private:
  struct Past {
    Stamp stamp = 0;
    RangeImage image;
    Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
    std::vector<std::uint8_t> moving;  ///< 1 for each cell that saw what was found to move

    /// Whether what the cell saw was moving.
    bool is_moving(int ring, int column) const {
      return moving[static_cast<std::size_t>(ring) * static_cast<std::size_t>(image.columns()) +
                    static_cast<std::size_t>(column)] != 0;
    }
  };
  enum class Evidence : std::uint8_t { kNone, kUnknown, kStatic, kFree };

  std::vector<RemovalReason> plain(const DeskewedScan& scan, const RangeImage& image) const;
  std::vector<RemovalReason> full(const DeskewedScan& scan, const RangeImage& image,
                                  const Eigen::Isometry3d& T_odom_lidar) const;
  std::vector<const Past*> chosen_past(Stamp now) const;
  /// What the earlier scans say of each of `points`.
  std::vector<Evidence> weigh(const std::vector<Eigen::Vector3f>& points,
                              const std::vector<const Past*>& past,
                              const Eigen::Isometry3d& T_odom_lidar) const;
  /// Which of `points` belong to what drives ahead of the sensor, so that it hid its own place from the
  /// earlier scans: one of them saw it in the same direction, nearer or farther by what it may have fallen
  /// back or got away since, and that place is seen through at `now`.
  std::vector<bool> drive_along(const std::vector<Eigen::Vector3f>& points,
                                const std::vector<const Past*>& past, const RangeImage& image,
                                const Eigen::Isometry3d& T_odom_lidar, Stamp now) const;
  float margin_m(float range_m) const;
  void remember(const DeskewedScan& scan, const RangeImage& image, const Eigen::Isometry3d& T_odom_lidar,
                const std::vector<RemovalReason>& reasons);

  DynamicConfig config_;
  std::deque<Past> history_;  ///< oldest first
};

}  // namespace fdi_lio::scan
