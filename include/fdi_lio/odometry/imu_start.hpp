#pragma once

#include <optional>
#include <vector>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/common/reporter.hpp"
#include "fdi_lio/imu/imu_types.hpp"
#include "fdi_lio/imu/initialisation.hpp"
#include "fdi_lio/odometry/moving_start.hpp"
#include "fdi_lio/odometry/smoother.hpp"

namespace fdi_lio::odometry {

/// Watches the first scans until gravity, biases and velocity are known well enough for the IMU to predict
/// the next ones.
class ImuStart {
 public:
  /// A state from which the smoother can start with the IMU, and how well it is known.
  struct Found {
    imu::NavState state;
    Smoother::InitialSigma sigma;
    std::optional<MovingStart> start;  ///< of the first scan, where an alignment of all of them tells it
  };

  ImuStart(const Config& config, Reporter* reporter) : config_(config), reporter_(reporter) {}

  /// What the IMU's newest samples at rest say: gravity and the gyro's biases, a velocity of zero. Nothing
  /// while they move, or while `newest` moves by more than 0.1 m/s.
  std::optional<Found> at_rest(const imu::NavState& newest, const imu::Preintegration& imu) const;

  /// `first` with what the review of a start in motion found. With an IMU it is good enough to predict the
  /// next scans from the start: along a road that the lidar hardly sees, the accelerometer holds the velocity
  /// better than scans alone would.
  Found moving(const imu::NavState& first, const MovingStart& start) const;

  /// Takes one more interval from `before` to `newest`, whose poses the scans alone gave; after
  /// `imu.moving_init_scans` of them, what aligns them with the IMU (`imu::align_in_motion`). Nothing while
  /// gravity so found is off by more than 0.5 m/s^2, which is reported: then the first interval is left out.
  /// While the ground (its normal in odom) is steep against it (`is_steep`) more intervals are waited for,
  /// and no start is told.
  std::optional<Found> in_motion(const imu::NavState& before, const imu::NavState& newest,
                                 const imu::Preintegration& imu,
                                 const std::optional<Eigen::Vector3d>& ground_normal);

  std::size_t interval_count() const { return intervals_.size(); }

  /// The number of intervals after which `in_motion` waits no longer for gravity to be known better.
  static std::size_t most_intervals(const ImuConfig& config);

  /// Forgets the intervals taken so far.
  void reset() { intervals_.clear(); }

 private:
  Config config_;
  Reporter* reporter_;
  imu::NavState first_;  ///< where the first interval begins
  std::vector<imu::AlignmentInterval> intervals_;
};

}  // namespace fdi_lio::odometry
