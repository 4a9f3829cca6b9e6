#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "fdi_lio/common/time.hpp"
#include "fdi_lio/mapping/global_config.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// What a receiver says (sensor_msgs/NavSatFix).
struct GnssFix {
  Stamp stamp = 0;
  int status = -1;  ///< -1 no fix, 0 fix, 1 satellite-based, 2 ground-based augmentation
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;
  bool has_covariance = false;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< ENU [m^2]
};

/// A place on the earth (WGS 84).
struct GeodeticPoint {
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  double altitude_m = 0.0;
};

enum class GnssVerdict {
  kAccepted,
  kWaiting,  ///< before the alignment: kept for it
  kNoFix,    ///< the receiver has no fix, or numbers that are none
  kPoorCovariance,
  kOutlier,  ///< far from where the estimate puts the antenna
};

const char* to_text(GnssVerdict verdict);

/// A fix that is tied to a keyframe.
struct TiedFix {
  std::size_t node = 0;
  Eigen::Vector3d p_imu = Eigen::Vector3d::Zero();  ///< antenna in the IMU frame of the keyframe
  Eigen::Vector3d p_map = Eigen::Vector3d::Zero();  ///< antenna by the present estimate
  double path_m = 0.0;                              ///< way of the odometry up to the fix
};

/// Turns fixes into positions in ENU (GeographicLib, origin at the first usable fix), finds where the map
/// lies in ENU while driving, and sorts out outliers.
class GnssAligner {
 public:
  explicit GnssAligner(const GnssConfig& config, double drift_share);
  ~GnssAligner();

  /// Judges one fix. When accepted, `position` is what the pose graph gets. `alignment`: of the graph, once
  /// there is one.
  GnssVerdict add(const GnssFix& fix, const TiedFix& tied, const std::optional<EnuAlignment>& alignment,
                  PositionFix* position);

  /// The alignment, as soon as the fixes that wait are far enough apart and agree; `positions` are those that
  /// agree. Nothing otherwise.
  std::optional<EnuAlignment> try_align(std::vector<PositionFix>* positions);

  /// Where ENU has its origin; nothing before the first usable fix.
  std::optional<GeodeticPoint> origin() const;

 private:
  struct Waiting {
    TiedFix tied;
    PositionFix position;
    double sigma_m;
  };
  class Origin;

  EnuAlignment from_pair(const Waiting& a, const Waiting& b) const;
  std::vector<std::size_t> inliers_of(const EnuAlignment& alignment) const;
  EnuAlignment fit(const std::vector<std::size_t>& inliers) const;
  double extent_m() const;

  GnssConfig config_;
  double drift_share_;
  std::unique_ptr<Origin> origin_;
  std::vector<Waiting> waiting_;
  double accepted_at_m_ = 0.0;
};

}  // namespace fdi_lio::mapping
