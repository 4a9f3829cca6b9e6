#pragma once

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/matching/local_map.hpp"
#include "fdi_lio/matching/match_input.hpp"
#include "fdi_lio/matching/scan_matcher.hpp"

namespace fdi_lio::odometry {

/// A local map to come, made of scans that the present one does not know: after a gap the sensor may be
/// somewhere else for good. It is of use when several scans in a row know each other at their predicted
/// poses, and not much better as something that moves along with the sensor. A covered lidar never gets so
/// far, and the present map stays for when the sensor sees again.
class MapCandidate {
 public:
  explicit MapCandidate(const Config& config);

  /// Takes a scan that the present map does not know, `input` made of `features`. True when enough scans in a
  /// row have known those before them.
  bool add(const FeatureSet& features, const matching::MatchInput& input, const imu::NavState& predicted);

  /// A scan was matched with the present map: there is no need.
  void reset();

  /// The map; it is empty afterwards.
  matching::LocalMap take();

 private:
  Config config_;
  Eigen::Isometry3d T_imu_lidar_;
  matching::ScanMatcher matcher_;
  matching::LocalMap map_;
  matching::LocalMap along_;  ///< of the same scans, in the IMU's frame: what moves along
  int agreeing_ = 0;
};

}  // namespace fdi_lio::odometry
