#pragma once

#include <cstddef>
#include <iosfwd>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "fdi_lio/common/pose_tangent.hpp"

namespace fdi_lio::mapping {

/// A measured pose of keyframe `to` in keyframe `from` (IMU frames). Tangent order [dtheta, dt]: dtheta
/// perturbs the rotation on the right (axes of `to`), dt is added to the translation (axes of `from`).
struct RelativePose {
  std::size_t from = 0;
  std::size_t to = 0;
  Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
  Matrix6d information = Matrix6d::Identity();  ///< may be singular: what is not known is not constrained
};

/// What another odometry says of the way between two keyframes. Its ways may all be too long or too short by
/// the same share (tyres, the scale of a camera), which the graph estimates.
struct ExternalStep {
  RelativePose measured;
  /// The part of the translation that the scale belongs to, in the axes of `from`; the rest is the lever arm.
  Eigen::Vector3d way = Eigen::Vector3d::Zero();
};

/// An antenna position in ENU, seen from keyframe `node`.
struct PositionFix {
  std::size_t node = 0;
  Eigen::Vector3d p_imu = Eigen::Vector3d::Zero();  ///< antenna in the IMU frame of the keyframe [m]
  Eigen::Vector3d p_enu = Eigen::Vector3d::Zero();  ///< [m]
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();  ///< in ENU axes [1/m^2]
};

/// Which way is down at keyframe `node`.
struct GravityDirection {
  std::size_t node = 0;
  Eigen::Vector3d down_imu = Eigen::Vector3d::Zero();  ///< unit vector in the IMU frame of the keyframe
  Eigen::Vector3d down_map = Eigen::Vector3d::Zero();  ///< unit vector in map
  double sigma_rad = 1.0;
};

/// Where the map lies in ENU: rotation about the vertical and translation (roll and pitch are known from
/// gravity). p_enu = R_z(yaw) p_map + t.
struct EnuAlignment {
  double yaw_rad = 0.0;
  Eigen::Vector3d t_enu_map = Eigen::Vector3d::Zero();

  Eigen::Isometry3d T_enu_map() const;
};

struct PoseGraphSettings {
  /// Squared normalised residual at which a loop counts half in value. Wider than chi-square, for loops are
  /// verified before, and the odometry may drift more steadily than its random walk says.
  double loop_scale_sq = 100.0;
  /// The same for a position: 99 % of chi-square with 3 degrees of freedom.
  double position_scale_sq = 11.3;
  /// The same for a step of another odometry, 6 degrees of freedom.
  double external_scale_sq = 16.8;
  /// Standard deviation of the other odometry's scale.
  double external_scale_sigma = 0.03;
  int max_iterations = 30;
};

/// Poses T_map_imu of keyframes with odometry, loops and positions, solved by Ceres (sparse Cholesky, one
/// thread: bit-identical results). Loops have a Geman-McClure kernel that starts wide enough for the worst
/// new loop and narrows down (graduated non-convexity: Yang et al., RA-L 2020, eqs. 4-8), so that a true loop
/// after much drift pulls the graph and a wrong one among true ones loses its weight. The problem is kept
/// between solves, and each solve starts from the last solution.
class PoseGraph {
 public:
  explicit PoseGraph(const PoseGraphSettings& settings);
  ~PoseGraph();
  PoseGraph(PoseGraph&&) noexcept;
  PoseGraph& operator=(PoseGraph&&) noexcept;

  /// Adds a node, its pose being the start of the optimisation. The first node is held where it is.
  std::size_t add_node(const Eigen::Isometry3d& T_map_imu);

  void add_odometry(const RelativePose& measured);

  /// Adds what another odometry says of the same way; wheels slip, so it has a Geman-McClure kernel.
  void add_external_odometry(const ExternalStep& step);

  /// True way over the way that the other odometry says; 1 before it says anything.
  double external_scale() const;

  /// Gravity at a node, instead of what was said of it before.
  void set_gravity(const GravityDirection& measured);

  /// Returns the loop's index.
  std::size_t add_loop(const RelativePose& measured);

  /// Sets where the alignment to ENU starts; from then on positions can be added.
  void start_alignment(const EnuAlignment& alignment);
  void add_position(const PositionFix& fix);

  /// Optimises. False when Ceres found no usable solution; poses are then as before.
  bool solve();

  Eigen::Isometry3d pose(std::size_t node) const;
  EnuAlignment alignment() const;

  /// Weight that the kernel gave to a loop in the last solution: 1 taken fully, 0 ignored.
  double loop_weight(std::size_t loop) const;

  /// Squared normalised residual of a relative pose at the present poses: chi-square distributed with 6
  /// degrees of freedom when the poses are right and the information is honest.
  double squared_error(const RelativePose& measured) const;

  std::size_t node_count() const;
  const std::vector<RelativePose>& odometry() const;
  const std::vector<RelativePose>& loops() const;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace fdi_lio::mapping
