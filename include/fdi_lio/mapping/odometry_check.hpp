#pragma once

#include <cstddef>
#include <deque>

#include "fdi_lio/mapping/pose_graph.hpp"

namespace fdi_lio::mapping {

/// Whether the steps of the odometry are what the clouds of the keyframes show. A healthy odometry hardly
/// deviates from a registration of a keyframe with those just before it: it has seen the same points, and
/// more. Where it does, it was disturbed, and the clouds know better: loops close such a way, but do not give
/// a lap its shape back.
class OdometryCheck {
 public:
  /// Whether the next step is to be registered: each one while the last kWindow are not all as they should be
  /// or have not come yet, else one in kSparse. To be asked once a step.
  bool is_due();

  /// Whether more than half of the last kWindow registered steps deviate, of five at least.
  bool contradicts() const;

  /// What the graph gets of a step: the odometry, or, where the clouds contradict it, the odometry corrected
  /// by the registration,
  ///   K = s C (s C + C_r)^-1,   T = T_odometry moved by K (T_registered - T_odometry),
  ///   covariance C + (I - K) s C,
  /// C and C_r the covariances of the two, s the mean of chi-square over its six degrees of freedom in that
  /// window, 1 at least: along the axis of a tunnel, where C_r is large, the odometry stays.
  RelativePose checked(const RelativePose& odometry, const RelativePose& registered);

  /// The step could not be registered: nothing speaks against it.
  void unregistered() { remember(0.0); }

 private:
  static constexpr std::size_t kWindow = 10;
  static constexpr std::size_t kSparse = 20;

  void remember(double deviation);

  std::deque<double> deviations_;  ///< chi-square over six, of the last registered steps
  std::size_t unchecked_ = 0;      ///< steps since the last that was
};

}  // namespace fdi_lio::mapping
