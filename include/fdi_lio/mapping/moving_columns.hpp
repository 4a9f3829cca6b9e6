#pragma once

#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/key_index.hpp"
#include "fdi_lio/common/scan_types.hpp"

namespace fdi_lio::mapping {

/// The upright columns in which a scan saw something move. Feet and wheels next to the ground, the rest of a
/// body that was only seen in part: what else the scan has there is not worth a place in a map, which other
/// scans fill when the column is empty.
class MovingColumns {
 public:
  /// Of the points that were removed as moving; `R_level_lidar` turns the lidar's frame upright.
  MovingColumns(const DeskewedScan& scan, const Eigen::Matrix3d& R_level_lidar);

  /// Whether a place (lidar frame) is within 0.25 to 0.5 m of the plumb line of a moving point and at most
  /// 0.5 m below the lowest, or 0.2 m above the highest, of those beside it.
  bool hold(const Eigen::Vector3f& position) const;

  /// `points` without those that the columns hold.
  std::vector<Point> without(const std::vector<Point>& points) const;

 private:
  struct Span {
    float lowest_m;
    float highest_m;
  };

  Eigen::Matrix3f R_level_lidar_;
  KeyIndex index_;
  std::vector<Span> spans_;
};

}  // namespace fdi_lio::mapping
