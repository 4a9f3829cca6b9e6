#pragma once

#include "fdi_lio/common/parameter_visitor.hpp"

namespace fdi_lio::odometry {

/// What the degeneracy changes in mapping, each by itself (mapping/adaptation.hpp has the equations).
struct AdaptationConfig {
  bool voxel = false;
  double voxel_gain = 0.2;
  bool iterations = false;
  double iterations_gain = 0.5;
  bool weights = false;
  double plane_gain = 0.2;
  double edge_gain = 0.5;
  bool noise = true;
  double noise_gain = 1.0;
  bool keyframes = false;
  double keyframe_decay = 0.5;
  double keyframe_gain = 0.2;
  double keyframe_least_distance_m = 0.1;

  void visit(ParameterVisitor& visitor);
};

}  // namespace fdi_lio::odometry
