#include "fdi_lio/mapping/graph_measurements.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::mapping {

namespace {

/// The antenna at the stamp of the fix, by the odometry between the two keyframes about it.
TiedFix tied_to_frames(const GnssFix& fix, const Eigen::Vector3d& p_imu_antenna,
                       const std::vector<OdometryFrame>& frames,
                       const std::vector<Eigen::Isometry3d>& poses) {
  const auto after =
      std::lower_bound(frames.begin(), frames.end(), fix.stamp,
                       [](const OdometryFrame& frame, Stamp value) { return frame.stamp < value; });
  const auto next = static_cast<std::size_t>(after - frames.begin());
  TiedFix tied;
  tied.node = next == 0 ? 0 : next - 1;
  const OdometryFrame& before = frames[tied.node];
  const double span_s = seconds_between(before.stamp, frames[next].stamp);
  const double share = span_s > 0.0 ? seconds_between(before.stamp, fix.stamp) / span_s : 0.0;
  const Eigen::Isometry3d T_part =
      before.T_odom_imu.inverse() * interpolated(before.T_odom_imu, frames[next].T_odom_imu, share);
  tied.p_imu = T_part * p_imu_antenna;
  tied.p_map = poses[tied.node] * tied.p_imu;
  tied.path_m = before.path_m + T_part.translation().norm();
  return tied;
}

}  // namespace

GraphMeasurements::GraphMeasurements(const Config& config, Reporter* reporter)
    : gravity_sigma_rad_(config.loop.gravity_sigma_deg * M_PI / 180.0),
      solve_every_(config.loop.solve_every),
      p_imu_antenna_(config.gnss.p_imu_antenna),
      use_altitude_(config.gnss.use_altitude),
      reporter_(reporter),
      aligner_(config.gnss, config.loop.drift_share),
      external_(config.external_odometry) {}

void GraphMeasurements::add_gravity(const std::vector<OdometryFrame>& frames,
                                    const Eigen::Isometry3d& T_map_imu, const Eigen::Vector3d& down_imu,
                                    PoseGraph* graph) {
  const OdometryFrame& newest = frames.back();
  if (newest.begins_session) down_odom_.reset();
  if (!down_odom_ && !down_imu.isZero()) {
    down_odom_ = newest.T_odom_imu.linear() * down_imu;
    if (!down_map_) down_map_ = T_map_imu.linear() * down_imu;
  }
  if (gravity_sigma_rad_ == 0.0 || !down_odom_) return;
  // Where the keyframe does not know it, as before a start in motion is over, the odometry carries it on.
  const Eigen::Vector3d carried_imu = newest.T_odom_imu.linear().transpose() * *down_odom_;
  graph->set_gravity(
      {frames.size() - 1, down_imu.isZero() ? carried_imu : down_imu, *down_map_, gravity_sigma_rad_});
}

void GraphMeasurements::set_gravity(std::size_t frame, const Eigen::Vector3d& down_imu,
                                    const Eigen::Vector3d& down_map, PoseGraph* graph) const {
  if (gravity_sigma_rad_ > 0.0) graph->set_gravity({frame, down_imu, down_map, gravity_sigma_rad_});
}

void GraphMeasurements::add_external(const ExternalPose& pose) {
  if (external_.add(pose)) return;
  reporter_->report(Severity::kWarning, "external_odometry",
                    "a message of the other odometry was dropped: its stamp does not follow the one before, "
                    "or its pose is none (sensor.external_odometry_topic)");
}

bool GraphMeasurements::use(const std::vector<OdometryFrame>& frames,
                            const std::vector<Eigen::Isometry3d>& poses, PoseGraph* graph) {
  while (!waiting_fixes_.empty() && waiting_fixes_.front().stamp <= frames.back().stamp) {
    const GnssFix fix = waiting_fixes_.front();
    waiting_fixes_.pop_front();
    // What the receiver said before the start has no pose.
    if (fix.stamp < frames.front().stamp) continue;
    // Once aligned the poses change, which the next fix is judged by.
    if (use_fix(fix, tied_to_frames(fix, p_imu_antenna_, frames, poses), graph)) return true;
  }
  use_external(frames, graph);
  return unsolved_ >= solve_every_;
}

void GraphMeasurements::add_position(const PositionFix& position, PoseGraph* graph) {
  graph->add_position(position);
  positions_.push_back(position);
}

EnuAlignment GraphMeasurements::with_height(EnuAlignment alignment,
                                            const std::vector<Eigen::Isometry3d>& poses) const {
  if (use_altitude_ || positions_.empty()) return alignment;
  std::vector<double> heights;
  for (const PositionFix& fix : positions_)
    heights.push_back(fix.p_enu.z() - (poses[fix.node] * fix.p_imu).z());
  const auto middle = heights.begin() + static_cast<std::ptrdiff_t>(heights.size() / 2);
  std::nth_element(heights.begin(), middle, heights.end());
  alignment.t_enu_map.z() = *middle;
  return alignment;
}

/// True when it was the one that the map could be aligned with.
bool GraphMeasurements::use_fix(const GnssFix& fix, const TiedFix& tied, PoseGraph* graph) {
  std::optional<EnuAlignment> alignment;
  if (is_aligned_) alignment = graph->alignment();
  PositionFix position;
  const GnssVerdict verdict = aligner_.add(fix, tied, alignment, &position);
  fixes_.push_back({fix.stamp, verdict});
  if (verdict == GnssVerdict::kAccepted) {
    add_position(position, graph);
    ++unsolved_;
  }
  if (verdict != GnssVerdict::kWaiting) return false;
  std::vector<PositionFix> positions;
  const std::optional<EnuAlignment> found = aligner_.try_align(&positions);
  if (!found) return false;
  is_aligned_ = true;
  graph->start_alignment(*found);
  for (const PositionFix& each : positions) add_position(each, graph);
  reporter_->report(Severity::kInfo, "gnss_aligned", "the map is aligned to the GNSS fixes");
  return true;
}

void GraphMeasurements::use_external(const std::vector<OdometryFrame>& frames, PoseGraph* graph) {
  while (external_next_ + 1 < frames.size() && external_.reaches(frames[external_next_ + 1].stamp)) {
    const OdometryFrame& to = frames[external_next_ + 1];
    std::optional<ExternalStep> step = external_.step(frames[external_next_].stamp, to.stamp);
    if (step && !to.begins_session) {
      step->measured.from = external_next_;
      step->measured.to = external_next_ + 1;
      graph->add_external_odometry(*step);
      ++unsolved_;
    }
    ++external_next_;
    external_.forget_before(to.stamp);
  }
}

}  // namespace fdi_lio::mapping
