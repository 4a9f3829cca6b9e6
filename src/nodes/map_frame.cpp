#include "map_frame.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <string>
#include <utility>

#include "message_queue.hpp"
#include <sensor_msgs/PointCloud2.h>
#include <tf2_eigen/tf2_eigen.h>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/ros/message_conversions.hpp"
#include <fdi_lio/GnssVerdict.h>
#include <fdi_lio/LocalisationStatus.h>
#include <fdi_lio/LoopCandidate.h>

namespace fdi_lio::nodes {

namespace {

constexpr double kDegree = M_PI / 180.0;
/// map -> odom is stamped ahead, so that it can be combined with an odom -> base_link that is newer than the
/// last scan.
constexpr double kMapTransformAheadS = 0.5;
/// From one update of what is shown to the next, in durations of the last one: the thread has loops to look
/// for.
constexpr double kPeriodOfDisplay = 10.0;

geometry_msgs::Point to_point(const Eigen::Vector3d& p) {
  geometry_msgs::Point point;
  point.x = p.x();
  point.y = p.y();
  point.z = p.z();
  return point;
}

LoopCandidate to_message(const mapping::LoopCandidate& loop, const mapping::GlobalOptimizer& global,
                         const std::string& map_frame) {
  LoopCandidate message;
  message.header.stamp = ros_bridge::to_ros_time(loop.stamp_to);
  message.header.frame_id = map_frame;
  message.earlier = ros_bridge::to_ros_time(loop.stamp_from);
  message.source = to_text(loop.source);
  message.verdict = to_text(loop.verdict);
  const Eigen::Isometry3d T_map_from = global.T_map_imu(loop.measured.from);
  message.from = to_point(T_map_from.translation());
  message.to = to_point(T_map_from * loop.measured.T_from_to.translation());
  message.overlap = loop.overlap;
  message.wall_share = loop.wall_share;
  message.residual = loop.residual_m;
  message.chi_square = loop.chi_square;
  return message;
}

LocalisationStatus to_message(const localisation::LocalisationResult& result, const std::string& map_frame) {
  LocalisationStatus message;
  message.header.stamp = ros_bridge::to_ros_time(result.stamp);
  message.header.frame_id = map_frame;
  message.state = static_cast<std::uint8_t>(result.state);
  message.verdict = to_text(result.registration.verdict);
  message.overlap = result.registration.overlap;
  message.wall_share = result.registration.wall_share;
  message.residual = result.registration.residual_m;
  message.failures = static_cast<std::uint32_t>(result.failures);
  for (int cell = 0; cell < 36; ++cell)
    message.covariance[static_cast<std::size_t>(cell)] = result.covariance(cell / 6, cell % 6);
  return message;
}

/// Publishes the way as it is now, and what has been decided since the last time. Called in the global thread
/// only.
class Findings {
 public:
  Findings(PathPublisher path, ros::Publisher loops, ros::Publisher fixes, std::string map_frame,
           const Eigen::Isometry3d& T_imu_base)
      : path_(std::move(path)),
        loops_(std::move(loops)),
        fixes_(std::move(fixes)),
        map_frame_(std::move(map_frame)),
        T_imu_base_(T_imu_base) {}

  void publish(const mapping::GlobalOptimizer& global) {
    path_.publish(global.size(), [&](std::size_t k) {
      return evaluation::StampedPose{global.stamp(k), global.T_map_imu(k) * T_imu_base_};
    });
    verdicts_.resize(global.loops().size());
    for (std::size_t k = 0; k < verdicts_.size(); ++k) {
      const mapping::LoopCandidate& loop = global.loops()[k];
      if (verdicts_[k] == loop.verdict) continue;
      verdicts_[k] = loop.verdict;
      loops_.publish(to_message(loop, global, map_frame_));
    }
    for (; fix_count_ < global.fixes().size(); ++fix_count_) {
      GnssVerdict message;
      message.header.stamp = ros_bridge::to_ros_time(global.fixes()[fix_count_].stamp);
      message.header.frame_id = map_frame_;
      message.verdict = to_text(global.fixes()[fix_count_].verdict);
      fixes_.publish(message);
    }
  }

 private:
  PathPublisher path_;
  ros::Publisher loops_, fixes_;
  std::string map_frame_;
  Eigen::Isometry3d T_imu_base_;
  std::vector<std::optional<mapping::LoopVerdict>> verdicts_;
  std::size_t fix_count_ = 0;
};

}  // namespace

MapFrame::MapFrame(ros::NodeHandle handle, const Config& config, SensorFrames* frames, Reporter* reporter,
                   bool is_recorded)
    : config_(config),
      frames_(frames),
      reporter_(reporter),
      blend_(config.nodes.correction_time_constant_s),
      path_publisher_(handle, config.frames.map, static_cast<std::size_t>(config.nodes.path_poses)),
      is_recorded_(is_recorded) {
  map_publisher_ = handle.advertise<sensor_msgs::PointCloud2>("map/global", 1, true);
  loops_publisher_ = handle.advertise<LoopCandidate>("loops", 100);
  gnss_publisher_ = handle.advertise<GnssVerdict>("gnss/verdicts", 100);
  localisation_publisher_ = handle.advertise<LocalisationStatus>("localisation", 10, true);
  initial_pose_subscriber_ = handle.subscribe("/initialpose", 1, &MapFrame::on_initial_pose, this);
  if (!config.localisation.session.empty())
    loaded_ = make_localiser(mapping::load_session(config.localisation.session));
  begin_anew();
}

std::shared_ptr<localisation::LocaliserWorker> MapFrame::make_localiser(mapping::Session session) {
  return std::make_shared<localisation::LocaliserWorker>(
      config_, std::move(session), reporter_,
      [this, publisher = localisation_publisher_](const localisation::LocalisationResult& result) {
        publisher.publish(to_message(result, config_.frames.map));
        const std::lock_guard<std::mutex> lock(mutex_);
        if (is_recorded_) results_.push_back(result);
      });
}

std::size_t MapFrame::load(mapping::Session session) {
  const auto localiser = make_localiser(std::move(session));
  const std::lock_guard<std::mutex> lock(mutex_);
  loaded_ = localiser;
  return localiser->keyframes();
}

bool MapFrame::has_loaded() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return loaded_ != nullptr;
}

void MapFrame::begin_anew() {
  clouds_.clear();
  waiting_.clear();
  keyframe_count_ = 0;
  session_way_.clear();
  blend_.reset();
  display_ = std::make_shared<Display>(config_.nodes.global_map_voxel_m);
  displayed_ = std::future<void>();
  findings_.reset();
  keyframes_.reset();
  // Their threads end below, without the lock, for which they may wait.
  std::shared_ptr<mapping::GlobalWorker> ended_map;
  std::shared_ptr<localisation::LocaliserWorker> ended_localiser;
  bool is_new_session = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_new_session = loaded_ != nullptr;
    if (is_new_session) ended_localiser = std::exchange(localiser_, std::exchange(loaded_, nullptr));
    ended_map = std::exchange(global_, nullptr);  // the next one is made when the extrinsics are known
    poses_.clear();
    results_.clear();
  }
  if (is_new_session) session_points_ = localiser_->map_points(config_.nodes.global_map_voxel_m);
  if (!is_new_session && localiser_) localiser_->reset();
}

void MapFrame::on_initial_pose(const geometry_msgs::PoseWithCovarianceStampedConstPtr& message) {
  if (!localiser_) {
    ROS_WARN("an initial pose came, but no session is loaded to localise in (load_map)");
    return;
  }
  const auto T_base_imu = frames_->T_base_imu();
  if (!T_base_imu) return;
  Eigen::Isometry3d T_map_base;
  tf2::fromMsg(message->pose.pose, T_map_base);
  const Eigen::Isometry3d T_map_imu = T_map_base * *T_base_imu;
  const auto& covariance = message->pose.covariance;
  localisation::InitialPose pose;
  pose.x_m = T_map_imu.translation().x();
  pose.y_m = T_map_imu.translation().y();
  pose.yaw_rad = std::atan2(T_map_imu.linear()(1, 0), T_map_imu.linear()(0, 0));
  pose.sigma_m = std::sqrt(std::max(covariance[0], covariance[7]));
  pose.sigma_rad = std::sqrt(std::max(covariance[35], 0.0));
  // Who gives no covariance does not mean that the pose is exact.
  if (!(pose.sigma_m > 0.0)) pose.sigma_m = config_.localisation.initial_sigma_translation_m;
  if (!(pose.sigma_rad > 0.0)) pose.sigma_rad = config_.localisation.initial_sigma_rotation_deg * kDegree;
  if (!std::isfinite(pose.x_m + pose.y_m + pose.yaw_rad + pose.sigma_m + pose.sigma_rad)) {
    ROS_WARN("an initial pose with numbers that are none was ignored");
    return;
  }
  localiser_->set_initial_pose(pose);
}

/// The newest correction; nothing while the place in a session is not known.
std::optional<Eigen::Isometry3d> MapFrame::newest_correction() const {
  if (localiser_) return localiser_->T_map_odom();
  return global_ ? global_->T_map_odom() : Eigen::Isometry3d::Identity();
}

void MapFrame::send_transform(Stamp stamp, const Eigen::Isometry3d& T_map_odom) {
  geometry_msgs::TransformStamped message = tf2::eigenToTransform(T_map_odom);
  message.header.stamp = ros_bridge::to_ros_time(stamp) + ros::Duration(kMapTransformAheadS);
  message.header.frame_id = config_.frames.map;
  message.child_frame_id = config_.frames.odom;
  broadcaster_.sendTransform(message);
}

void MapFrame::add(const odometry::EstimateResult& estimate, const FeatureSet& features,
                   const Config& known) {
  if (!keyframes_) keyframes_.emplace(known.sensor.T_imu_lidar(), config_.mapping.output_map_voxel_m);
  const Stamp stamp = estimate.state.stamp;
  const Eigen::Isometry3d T_odom_imu = estimate.state.T_odom_imu();
  if (!localiser_ && !global_ && estimate.is_keyframe) {
    const std::lock_guard<std::mutex> lock(mutex_);
    global_ = std::make_shared<mapping::GlobalWorker>(known, reporter_);
  }
  const auto newest = newest_correction();
  if (newest) {
    const Eigen::Isometry3d T_map_odom = blend_.follow(stamp, *newest, T_odom_imu);
    if (config_.frames.publish_tf) send_transform(stamp, T_map_odom);
    if (localiser_ && estimate.is_keyframe) publish_session_way(stamp, T_map_odom * T_odom_imu);
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!localiser_) poses_.push_back({stamp, T_odom_imu});
    if (localiser_ && newest) poses_.push_back({stamp, *newest * T_odom_imu});
  }
  keyframe_count_ += estimate.is_keyframe ? 1 : 0;
  if (!estimate.is_keyframe && !(localiser_ && localiser_->wants(stamp))) return;
  waiting_.push_back({estimate, features});
  take_clouds();
}

void MapFrame::publish_session_way(Stamp stamp, const Eigen::Isometry3d& T_map_imu) {
  session_way_.push_back({stamp, T_map_imu * frames_->T_base_imu()->inverse()});
  path_publisher_.publish(session_way_.size(), [this](std::size_t k) { return session_way_[k]; });
}

void MapFrame::add_cloud(const DeskewedCloudConstPtr& cloud) {
  keep(cloud, &clouds_);
  take_clouds();
}

/// Gives the scans whose clouds have come to the map, or to the localisation.
void MapFrame::take_clouds() {
  while (!waiting_.empty()) {
    const odometry::EstimateResult& estimate = waiting_.front().estimate;
    const DeskewedCloudConstPtr cloud = take(&clouds_, ros_bridge::to_ros_time(estimate.state.stamp));
    if (!cloud && clouds_.empty()) return;  // it has yet to come
    if (cloud) {
      mapping::Keyframe keyframe =
          keyframes_->make(estimate, ros_bridge::to_scan(*cloud), waiting_.front().features);
      if (localiser_) {
        localiser_->add(std::move(keyframe));
      } else {
        global_->add(std::move(keyframe));
        publish_findings();
      }
    }
    waiting_.pop_front();
  }
}

/// The publishing is done in the global thread, when the keyframe before has been looked at.
void MapFrame::publish_findings() {
  if (!findings_) {
    const auto findings = std::make_shared<Findings>(path_publisher_, loops_publisher_, gnss_publisher_,
                                                     config_.frames.map, frames_->T_base_imu()->inverse());
    findings_ = [findings](const mapping::GlobalOptimizer& global) { findings->publish(global); };
  }
  global_->run(*findings_);
}

void MapFrame::add_fix(const mapping::GnssFix& fix) {
  // Before the first keyframe there is nothing that it could belong to.
  if (global_) global_->add_fix(fix);
}

void MapFrame::add_external(const mapping::ExternalPose& pose) {
  if (global_) global_->add_external(pose);
}

void MapFrame::publish_map(Stamp stamp) {
  if (map_publisher_.getNumSubscribers() == 0) return;
  const double period_s =
      std::max(config_.nodes.global_map_period_s, kPeriodOfDisplay * display_->duration_s.load());
  if (seconds_since(published_at_) <= period_s) return;
  if (localiser_) {
    published_at_ = SteadyClock::now();
    map_publisher_.publish(ros_bridge::to_cloud(session_points_, stamp, config_.frames.map));
  } else if (global_) {
    publish_growing_map();
  }
}

void MapFrame::publish_growing_map() {
  if (displayed_.valid() && displayed_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
  try {
    if (displayed_.valid()) displayed_.get();
  } catch (const std::exception& error) {
    reporter_->report(Severity::kError, "map_display", std::string("map/global: ") + error.what());
  }
  published_at_ = SteadyClock::now();
  displayed_ = global_->run([display = display_, publisher = map_publisher_,
                             frame = config_.frames.map](const mapping::GlobalOptimizer& global) {
    if (global.size() == 0) return;
    const auto begin = SteadyClock::now();
    display->map.follow(global);
    publisher.publish(ros_bridge::to_cloud(display->map.points(), global.stamp(global.size() - 1), frame));
    display->duration_s = seconds_since(begin);
  });
}

void MapFrame::write(pipeline::RunDirectory* directory, double map_voxel_m) {
  take_clouds();
  if (localiser_) {
    const std::lock_guard<std::mutex> lock(mutex_);
    directory->write_localisation(poses_, results_);
  } else if (global_) {
    directory->write_global(global_->finish(), map_voxel_m);
  }
}

MapSnapshot MapFrame::snapshot() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return {global_, localiser_ != nullptr, poses_};
}

void MapFrame::fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) const {
  using diagnostic_msgs::DiagnosticStatus;
  status->add("keyframes", keyframe_count_);
  if (global_) {
    status->add("keyframes that wait for loop search", global_->backlog());
    if (!global_->error().empty()) status->mergeSummary(DiagnosticStatus::ERROR, global_->error());
  }
  if (!localiser_) return;
  const auto result = localiser_->result();
  status->add("localisation", result ? to_text(result->state) : "waits for the first scan");
  if (result) status->add("localisation verdict", to_text(result->registration.verdict));
  if (result && result->state == localisation::LocalisationState::kLost)
    status->mergeSummary(DiagnosticStatus::WARN, "the place in the session is lost");
  if (!localiser_->error().empty()) status->mergeSummary(DiagnosticStatus::ERROR, localiser_->error());
}

}  // namespace fdi_lio::nodes
