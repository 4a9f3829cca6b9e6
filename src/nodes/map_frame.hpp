#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "map_services.hpp"
#include "node_base.hpp"
#include "path_publisher.hpp"
#include "sensor_frames.hpp"
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <tf2_ros/transform_broadcaster.h>

#include "fdi_lio/localisation/localiser_worker.hpp"
#include "fdi_lio/mapping/correction_blend.hpp"
#include "fdi_lio/mapping/global_worker.hpp"
#include "fdi_lio/mapping/keyframe.hpp"
#include "fdi_lio/mapping/map_display.hpp"
#include "fdi_lio/odometry/estimate_result.hpp"
#include "fdi_lio/pipeline/run_directory.hpp"
#include <fdi_lio/DeskewedCloud.h>

namespace fdi_lio::nodes {

/// What mapping_optimization knows of the frame `map`: its own map with loops and fixes, or the place in a
/// saved session. Publishes map -> odom, path, keyframes, map/global, loops, GNSS verdicts and the
/// localisation's status. All is called from the node's callbacks, but for `snapshot` and `load`.
class MapFrame {
 public:
  /// With `localisation.session` begins to localise in it. Throws Error when that session is damaged.
  /// `is_recorded`: `write` will be called.
  MapFrame(ros::NodeHandle handle, const Config& config, SensorFrames* frames, Reporter* reporter,
           bool is_recorded);

  /// An empty map, or the session with its place unknown.
  void begin_anew();

  /// Takes the estimate of a scan. `known` has the extrinsics.
  void add(const odometry::EstimateResult& estimate, const FeatureSet& features, const Config& known);

  /// Takes the scan's cloud, before or after its estimate.
  void add_cloud(const DeskewedCloudConstPtr& cloud);

  void add_fix(const mapping::GnssFix& fix);
  void add_external(const mapping::ExternalPose& pose);

  /// Publishes map/global when it is time; the map is made in the global thread, and in about a tenth of
  /// its time at most.
  void publish_map(Stamp stamp);

  /// Waits until everything is in the map and writes it. Throws Error when the disk takes no more.
  void write(pipeline::RunDirectory* directory, double map_voxel_m);

  /// Reads the clouds of a session, which `has_loaded` then announces; returns the number of keyframes.
  std::size_t load(mapping::Session session);
  bool has_loaded() const;

  MapSnapshot snapshot() const;

  void fill_diagnostics(diagnostic_updater::DiagnosticStatusWrapper* status) const;

 private:
  /// Used in the global thread only, but for the duration.
  struct Display {
    explicit Display(double voxel_m) : map(voxel_m) {}
    mapping::MapDisplay map;
    std::atomic<double> duration_s{0.0};  ///< that the last update took
  };

  struct WaitingScan {
    odometry::EstimateResult estimate;
    FeatureSet features;
  };

  std::shared_ptr<localisation::LocaliserWorker> make_localiser(mapping::Session session);
  void on_initial_pose(const geometry_msgs::PoseWithCovarianceStampedConstPtr& message);
  std::optional<Eigen::Isometry3d> newest_correction() const;
  void send_transform(Stamp stamp, const Eigen::Isometry3d& T_map_odom);
  void publish_session_way(Stamp stamp, const Eigen::Isometry3d& T_map_imu);
  void publish_growing_map();
  void take_clouds();
  void publish_findings();

  Config config_;
  SensorFrames* frames_;
  Reporter* reporter_;
  mapping::CorrectionBlend blend_;
  std::deque<DeskewedCloudConstPtr> clouds_;
  std::deque<WaitingScan> waiting_;                  ///< for their clouds
  std::optional<mapping::KeyframeMaker> keyframes_;  ///< once the extrinsics are known
  std::size_t keyframe_count_ = 0;
  std::vector<evaluation::StampedPose> session_way_;  ///< T_map_base of each keyframe, when localising
  std::vector<Point> session_points_;                 ///< what is shown of a session
  std::shared_ptr<Display> display_;                  ///< what is shown of the map
  std::future<void> displayed_;                       ///< the update under way
  SteadyClock::time_point published_at_;
  std::optional<std::function<void(const mapping::GlobalOptimizer&)>>
      findings_;  ///< publishes way, loops and fixes

  tf2_ros::TransformBroadcaster broadcaster_;
  ros::Subscriber initial_pose_subscriber_;
  PathPublisher path_publisher_;
  ros::Publisher map_publisher_, loops_publisher_, gnss_publisher_, localisation_publisher_;

  bool is_recorded_;
  mutable std::mutex mutex_;                    ///< of what other threads read or write: what follows
  std::vector<evaluation::StampedPose> poses_;  ///< T_odom_imu of every scan; when localising T_map_imu
  std::vector<localisation::LocalisationResult> results_;  ///< when recorded
  std::shared_ptr<mapping::GlobalWorker> global_;
  std::shared_ptr<localisation::LocaliserWorker> localiser_;
  std::shared_ptr<localisation::LocaliserWorker> loaded_;  ///< by a service, not yet in use
};

}  // namespace fdi_lio::nodes
