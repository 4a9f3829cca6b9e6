#include "map_services.hpp"

#include <filesystem>
#include <future>
#include <utility>

#include "fdi_lio/common/error.hpp"
#include "fdi_lio/common/new_file.hpp"

namespace fdi_lio::nodes {

namespace {

namespace fs = std::filesystem;

/// Where to save what the user wants at `path`. Throws Error when that is no place.
std::string target(const std::string& path) {
  if (path.empty() || path[0] != '/')
    throw Error("the path '" + path + "' is not absolute: nothing was saved; begin it with /");
  const fs::path clean = fs::path(path).lexically_normal();
  return free_dated_path(clean.has_filename() ? clean.string() : clean.parent_path().string());
}

/// Runs `job` in the global thread and waits for it.
void run_in_global_thread(const MapSnapshot& snapshot,
                          std::function<void(const mapping::GlobalOptimizer&)> job) {
  if (!snapshot.global) throw Error("there is no map yet: nothing was saved");
  try {
    snapshot.global->run_optimised(std::move(job)).get();
  } catch (const std::future_error&) {
    throw Error("the node is ending: nothing was saved");
  }
}

}  // namespace

template <typename Service>
ros::ServiceServer MapServices::advertise(const std::string& name,
                                          void (MapServices::*method)(const typename Service::Request&,
                                                                      typename Service::Response*)) {
  const boost::function<bool(typename Service::Request&, typename Service::Response&)> callback =
      [this, name, method](typename Service::Request& request, typename Service::Response& response) {
        try {
          (this->*method)(request, &response);
          response.success = true;
          ROS_INFO("%s: %s", name.c_str(), response.message.c_str());
        } catch (const std::exception& error) {
          response = typename Service::Response();
          response.success = false;
          response.message = error.what();
          ROS_ERROR("%s: %s", name.c_str(), error.what());
        }
        return true;
      };
  return handle_.advertiseService(name, callback);
}

MapServices::MapServices(ros::NodeHandle handle, const Config& config, Owner owner)
    : config_(config), owner_(std::move(owner)), handle_(std::move(handle)), spinner_(1, &queue_) {
  handle_.setCallbackQueue(&queue_);
  servers_ = {advertise<SaveMap>("save_map", &MapServices::save_map),
              advertise<SaveTrajectory>("save_trajectory", &MapServices::save_trajectory),
              advertise<LoadMap>("load_map", &MapServices::load_map),
              advertise<Reset>("reset", &MapServices::reset)};
  spinner_.start();
}

MapServices::~MapServices() {
  for (ros::ServiceServer& server : servers_) server.shutdown();
  spinner_.stop();
}

void MapServices::save_map(const SaveMap::Request& request, SaveMap::Response* response) {
  mapping::SessionOptions options;
  options.map_format = mapping::to_cloud_format(request.format.empty() ? "pcd" : request.format);
  options.layers = request.layers != 0;
  options.map_voxel_m = request.resolution > 0.0 ? request.resolution : config_.mapping.output_map_voxel_m;
  if (!(request.resolution >= 0.0 && request.resolution <= 100.0))
    throw Error("the resolution must be 0 m to 100 m: nothing was saved");
  const std::string path = target(request.path);
  const MapSnapshot snapshot = owner_.snapshot();
  if (snapshot.is_localising)
    throw Error("localising in a session, which stays as it is: there is no map of one's own to save");
  run_in_global_thread(snapshot, [&](const mapping::GlobalOptimizer& global) {
    if (global.size() == 0) throw Error("there is no keyframe yet: nothing was saved");
    mapping::save_session(global, options, path);
    response->keyframes = static_cast<std::uint32_t>(global.size());
  });
  response->path = path;
  response->message = std::to_string(response->keyframes) + " keyframes saved in " + path;
  const std::string stopped = snapshot.global->error();
  if (!stopped.empty()) response->message += "; the map has not grown since this happened: " + stopped;
}

void MapServices::save_trajectory(const SaveTrajectory::Request& request,
                                  SaveTrajectory::Response* response) {
  const auto format = evaluation::to_trajectory_format(request.format.empty() ? "tum" : request.format);
  const std::string path = target(request.path);
  const std::string temporary = free_path(path + ".part");
  MapSnapshot snapshot = owner_.snapshot();
  if (snapshot.is_localising) {
    if (snapshot.poses.empty()) throw Error("the place in the session is not found yet: nothing was saved");
  } else {
    run_in_global_thread(snapshot, [&](const mapping::GlobalOptimizer& global) {
      for (evaluation::StampedPose& pose : snapshot.poses) pose.T = global.correct(pose.stamp, pose.T);
    });
  }
  std::error_code error;
  fs::create_directories(fs::path(path).parent_path(), error);
  try {
    evaluation::write_trajectory(temporary, snapshot.poses, format);
    flush_to_disk(temporary);
  } catch (const Error&) {
    fs::remove(temporary, error);
    throw;
  }
  rename_to_new(temporary, path);
  response->path = path;
  response->poses = static_cast<std::uint32_t>(snapshot.poses.size());
  response->message = std::to_string(response->poses) + " poses saved in " + path;
}

void MapServices::load_map(const LoadMap::Request& request, LoadMap::Response* response) {
  if (request.path.empty() || request.path[0] != '/')
    throw Error("the path '" + request.path + "' is not absolute: nothing was loaded; begin it with /");
  response->keyframes = static_cast<std::uint32_t>(owner_.localise(mapping::load_session(request.path)));
  response->message =
      "localising in " + request.path + ", which has " + std::to_string(response->keyframes) + " keyframes";
}

void MapServices::reset(const Reset::Request& /*request*/, Reset::Response* response) {
  owner_.reset();
  response->message = "all nodes have begun anew";
}

}  // namespace fdi_lio::nodes
