#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Geometry>

#include "fdi_lio/mapping/keyframe_store.hpp"
#include "fdi_lio/mapping/loop_verifier.hpp"
#include "fdi_lio/mapping/place_descriptor.hpp"
#include "fdi_lio/mapping/session_io.hpp"

namespace fdi_lio::localisation {

/// The keyframes of a saved session, to register scans with. Nothing changes them.
class SessionMap {
 public:
  /// Reads all clouds; those beyond `cloud_memory_mb` go to a temporary file. Throws Error when one cannot be
  /// read or stored.
  SessionMap(mapping::Session session, int cloud_memory_mb);

  std::size_t size() const { return session_.keyframes.size(); }
  const Eigen::Isometry3d& T_map_imu(std::size_t keyframe) const {
    return session_.keyframes[keyframe].T_map_imu;
  }

  /// The keyframe nearest to `p_map`.
  std::size_t nearest(const Eigen::Vector3d& p_map) const;

  /// Height of the keyframe that is nearest on the ground plan.
  double height_at(const Eigen::Vector2d& p_map) const;

  /// Keyframes within `radius_m` of keyframe `center`, in its IMU frame; at most `limit`, evenly spread.
  std::vector<mapping::PlacedCloud> submap(std::size_t center, double radius_m, std::size_t limit);

  /// All surfaces in `map`, one mean point a voxel.
  std::vector<Point> points(double voxel_m);

  /// Describes a cloud in the IMU frame as the session's own were.
  mapping::PlaceDescriptor describe(const std::vector<Point>& points,
                                    const Eigen::Matrix3d& R_odom_imu) const;

  /// The keyframes that look most like `place`, at least `apart_m` from each other.
  std::vector<mapping::AlikePlace> alike(const mapping::PlaceDescriptor& place, double max_distance,
                                         std::size_t limit, double apart_m) const;

  /// Rotation of the IMU in keyframe `from` at a place that looks the same when it is turned by `yaw_rad`.
  Eigen::Matrix3d turned(std::size_t from, double yaw_rad, const Eigen::Matrix3d& R_odom_imu) const;

 private:
  mapping::Session session_;
  mapping::KeyframeStore store_;
};

}  // namespace fdi_lio::localisation
