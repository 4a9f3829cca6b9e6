#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/common/scan_types.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/imu/preintegration.hpp"
#include "fdi_lio/matching/local_map.hpp"
#include "fdi_lio/matching/match_input.hpp"
#include "fdi_lio/odometry/adaptation.hpp"
#include "fdi_lio/odometry/health_monitor.hpp"
#include "fdi_lio/odometry/registration.hpp"
#include "fdi_lio/odometry/shock_guard.hpp"
#include "fdi_lio/odometry/smoother.hpp"

namespace fdi_lio::odometry {

/// A scan that is to be aligned, and what with.
struct AlignerInput {
  const FeatureSet& features;                     ///< lidar frame, deskewed
  const std::optional<imu::Preintegration>& imu;  ///< since the scan before
  const imu::NavState& before;                    ///< what that scan was estimated to be
  const matching::LocalMap& map;
  const AdaptedSettings& adapted;
  bool is_unpredicted = false;  ///< among the first scans in the map, and nothing tells the motion
};

/// Aligns one scan after another: as it is predicted, or after a motion that the IMU has missed.
class ScanAligner {
 public:
  /// `shock_guard` says how far predictions are to be relied on, and is told of what the IMU missed.
  ScanAligner(const Config& config, ShockGuard* shock_guard, Reporter* reporter);

  /// Aligns the newest state of the smoother, which is predicted, with the map.
  Alignment align(const AlignerInput& input, Smoother* smoother);

  /// The map was begun anew: what was usual before says nothing any more.
  void begin_map_anew() {
    health_.restart();
    watched_scans_ = 0;
  }

 private:
  /// A scan aligned in another way, and what that makes of all that changes with it.
  struct Trial {
    Alignment alignment;
    Smoother smoother;
    Registration registration;
  };
  /// What the IMU missed of the motion before a scan.
  struct Missed {
    std::optional<Eigen::Vector3d> turn;  ///< rotation vector, body frame
    double velocity_mps = 0.0;            ///< by what its change of velocity may be off; 0: by nothing
  };
  /// What the IMU may have missed before a scan.
  struct Doubt {
    bool of_large_turns = false;  ///< these are sought in the map
    bool of_anything = false;     ///< the scan is aligned anew without heeding it
  };

  matching::MatchInput match_input(const FeatureSet& features, const AlignerInput& input) const;
  Alignment align_expected(const AlignerInput& input, const matching::MatchInput& features,
                           const Expectation& expectation, Smoother* smoother,
                           Registration* registration) const;
  Trial align_after(const imu::Preintegration& motion, const imu::MotionError& error_before,
                    const AlignerInput& input, const matching::MatchInput& features, Expectation expectation,
                    const Smoother& predicted) const;
  Trial align_missed(const Missed& missed, const AlignerInput& input, const matching::MatchInput& features,
                     const Smoother& predicted) const;
  Missed find_missed(const AlignerInput& input, const matching::MatchInput& features,
                     const Smoother& predicted) const;
  Doubt doubt_imu(const Alignment& alignment, const matching::MatchInput& features,
                  const std::optional<HealthMonitor::Prediction>& prediction, const imu::NavState& state);
  bool note_missed(const Missed& missed, const Vector6d& missing);
  Missed take_missed(const AlignerInput& input, const matching::MatchInput& features,
                     const Smoother& predicted, const Doubt& doubt, Alignment* alignment, Smoother* smoother);

  MappingConfig mapping_;
  SensorConfig sensor_;
  Eigen::Isometry3d T_imu_lidar_;
  Registration registration_;
  HealthMonitor health_;
  ShockGuard* shock_guard_;
  int watched_scans_ = 0;  ///< that are asked what the IMU missed, the present one included
};

}  // namespace fdi_lio::odometry
