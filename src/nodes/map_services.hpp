#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "fdi_lio/common/config.hpp"
#include "fdi_lio/evaluation/trajectory_writer.hpp"
#include "fdi_lio/mapping/global_worker.hpp"
#include "fdi_lio/mapping/session_io.hpp"
#include <fdi_lio/LoadMap.h>
#include <fdi_lio/Reset.h>
#include <fdi_lio/SaveMap.h>
#include <fdi_lio/SaveTrajectory.h>

namespace fdi_lio::nodes {

/// What there is to save at one moment.
struct MapSnapshot {
  std::shared_ptr<mapping::GlobalWorker> global;  ///< empty before the first keyframe, and when localising
  bool is_localising = false;
  std::vector<evaluation::StampedPose> poses;  ///< T_odom_imu of every scan; when localising T_map_imu
};

/// The services of mapping_optimization. They have a queue and a thread of their own, so that a save, which
/// may take long, never holds up scans; one is served at a time. What is saved is the map at the request:
/// the global thread writes it between two keyframes, and those that come meanwhile wait.
class MapServices {
 public:
  struct Owner {
    std::function<MapSnapshot()> snapshot;
    /// Asks all nodes to begin anew and waits until they have. Throws Error when they have not.
    std::function<void()> reset;
    /// Begins to localise in the session, of which it gives the number of keyframes. Throws Error when it
    /// cannot.
    std::function<std::size_t(mapping::Session)> localise;
  };

  /// `owner` is called from the services' thread, until the destructor has returned.
  MapServices(ros::NodeHandle handle, const Config& config, Owner owner);

  /// Waits for the service that is being answered.
  ~MapServices();

 private:
  void save_map(const SaveMap::Request& request, SaveMap::Response* response);
  void save_trajectory(const SaveTrajectory::Request& request, SaveTrajectory::Response* response);
  void load_map(const LoadMap::Request& request, LoadMap::Response* response);
  void reset(const Reset::Request& request, Reset::Response* response);

  /// Advertises a method; what it throws becomes an answer without success.
  template <typename Service>
  ros::ServiceServer advertise(const std::string& name,
                               void (MapServices::*method)(const typename Service::Request&,
                                                           typename Service::Response*));

  Config config_;
  Owner owner_;
  ros::CallbackQueue queue_;
  ros::NodeHandle handle_;
  std::vector<ros::ServiceServer> servers_;
  ros::AsyncSpinner spinner_;
};

}  // namespace fdi_lio::nodes
