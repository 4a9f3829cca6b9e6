#include "fdi_lio/mapping/pose_graph.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <unordered_map>

#include <ceres/problem.h>
#include <ceres/solver.h>

#include "fdi_lio/mapping/pose_graph_factors.hpp"

namespace fdi_lio::mapping {

namespace {

/// By how much the kernel narrows from one stage to the next, and how long a stage may take.
constexpr double kNarrowing = 4.0;
constexpr int kStageIterations = 2;
/// A step that moves the poses by less (root mean square of metres and radians) is the last one.
constexpr double kLastStep = 1e-3;
constexpr double kFunctionTolerance = 1e-6;
/// So wide that the first steps are those of Gauss-Newton. With Ceres' 1e4 the damping keeps back just what
/// loops are to bend, whole laps of many small steps, and such a short step looks like the last one.
constexpr double kTrustRegionRadius = 1e10;

/// Ends the optimisation after a step below kLastStep; Ceres' own tolerance is relative to how far the poses
/// are from the origin.
class StopAfterSmallStep : public ceres::IterationCallback {
 public:
  explicit StopAfterSmallStep(std::size_t node_count)
      : norm_(kLastStep * std::sqrt(static_cast<double>(node_count))) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    const bool is_last = summary.iteration > 0 && summary.step_is_successful && summary.step_norm < norm_;
    return is_last ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  double norm_;
};

ceres::Problem::Options problem_options() {
  ceres::Problem::Options options;
  options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  return options;
}

}  // namespace

Eigen::Isometry3d EnuAlignment::T_enu_map() const {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T.translation() = t_enu_map;
  return T;
}

class PoseGraph::Implementation {
 public:
  explicit Implementation(const PoseGraphSettings& settings)
      : settings_(settings),
        loop_loss_(settings.loop_scale_sq),
        position_loss_(settings.position_scale_sq),
        external_loss_(settings.external_scale_sq),
        problem_(problem_options()) {}

  std::size_t add_node(const Eigen::Isometry3d& T_map_imu) {
    poses_.emplace_back();
    double* block = poses_.back().data();
    pose_to_block(T_map_imu, block);
    problem_.AddParameterBlock(block, kPoseSize, &manifold_);
    if (poses_.size() == 1) problem_.SetParameterBlockConstant(block);
    return poses_.size() - 1;
  }

  void add_odometry(const RelativePose& measured) {
    odometry_.push_back(measured);
    add_relative(measured, nullptr);
  }

  void add_external_odometry(const ExternalStep& step) {
    if (!problem_.HasParameterBlock(&external_scale_)) {
      problem_.AddParameterBlock(&external_scale_, 1);
      problem_.AddResidualBlock(new ScalePriorCost(settings_.external_scale_sigma), nullptr,
                                &external_scale_);
    }
    problem_.AddResidualBlock(new ExternalStepCost(step), &external_loss_,
                              poses_.at(step.measured.from).data(), poses_.at(step.measured.to).data(),
                              &external_scale_);
  }

  double external_scale() const { return external_scale_; }

  void set_gravity(const GravityDirection& measured) {
    const auto [place, is_new] = gravity_.emplace(measured.node, nullptr);
    if (!is_new) {
      place->second->set_measured(measured);
      return;
    }
    place->second = new GravityCost(measured);
    problem_.AddResidualBlock(place->second, nullptr, poses_.at(measured.node).data());
  }

  std::size_t add_loop(const RelativePose& measured) {
    loops_.push_back(measured);
    add_relative(measured, &loop_loss_);
    return loops_.size() - 1;
  }

  void start_alignment(const EnuAlignment& alignment) {
    alignment_[0] = alignment.yaw_rad;
    Eigen::Map<Eigen::Vector3d>(alignment_.data() + 1) = alignment.t_enu_map;
    problem_.AddParameterBlock(alignment_.data(), kAlignmentSize);
  }

  void add_position(const PositionFix& fix) {
    problem_.AddResidualBlock(new PositionCost(fix), &position_loss_, poses_.at(fix.node).data(),
                              alignment_.data());
  }

  bool solve() {
    const std::deque<Block> before = poses_;
    const AlignmentBlock alignment_before = alignment_;
    const double scale_before = external_scale_;
    double worst = 0.0;
    for (std::size_t k = annealed_; k < loops_.size(); ++k) worst = std::max(worst, squared_error(loops_[k]));
    // Below its scale the kernel still pulls: no need to widen it.
    double widening = worst > settings_.loop_scale_sq ? 2.0 * worst / settings_.loop_scale_sq : 1.0;
    bool usable = true;
    while (widening > 1.0 && usable) {
      usable = solve_stage(widening, kStageIterations);
      widening /= kNarrowing;
    }
    usable = usable && solve_stage(1.0, settings_.max_iterations);
    annealed_ = loops_.size();
    if (usable) return true;
    // In place: Ceres knows the blocks by their addresses.
    std::copy(before.begin(), before.end(), poses_.begin());
    alignment_ = alignment_before;
    external_scale_ = scale_before;
    return false;
  }

  Eigen::Isometry3d pose(std::size_t node) const { return block_to_pose(poses_.at(node).data()); }

  EnuAlignment alignment() const {
    return {alignment_[0], Eigen::Map<const Eigen::Vector3d>(alignment_.data() + 1)};
  }

  double loop_weight(std::size_t loop) const { return loop_loss_.weight(squared_error(loops_.at(loop))); }

  double squared_error(const RelativePose& measured) const {
    Vector6d residuals;
    const double* blocks[] = {poses_.at(measured.from).data(), poses_.at(measured.to).data()};
    RelativePoseCost(measured).Evaluate(blocks, residuals.data(), nullptr);
    return residuals.squaredNorm();
  }

  std::size_t node_count() const { return poses_.size(); }
  const std::vector<RelativePose>& odometry() const { return odometry_; }
  const std::vector<RelativePose>& loops() const { return loops_; }

 private:
  using Block = std::array<double, kPoseSize>;
  using AlignmentBlock = std::array<double, kAlignmentSize>;

  void add_relative(const RelativePose& measured, ceres::LossFunction* loss) {
    problem_.AddResidualBlock(new RelativePoseCost(measured), loss, poses_.at(measured.from).data(),
                              poses_.at(measured.to).data());
  }

  bool solve_stage(double widening, int max_iterations) {
    loop_loss_.set_scale_sq(widening * settings_.loop_scale_sq);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    // Eigen's factorisation calls no BLAS, whose threads may change the order of sums.
    options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    options.num_threads = 1;
    options.max_num_iterations = max_iterations;
    options.function_tolerance = kFunctionTolerance;
    options.initial_trust_region_radius = kTrustRegionRadius;
    StopAfterSmallStep stop(poses_.size());
    options.callbacks.push_back(&stop);
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    return summary.IsSolutionUsable();
  }

  PoseGraphSettings settings_;
  PoseManifold manifold_;
  GemanMcClureLoss loop_loss_;
  GemanMcClureLoss position_loss_;
  GemanMcClureLoss external_loss_;
  std::deque<Block> poses_;  ///< a deque: addresses stay
  AlignmentBlock alignment_{};
  double external_scale_ = 1.0;
  std::vector<RelativePose> odometry_;
  std::vector<RelativePose> loops_;
  std::unordered_map<std::size_t, GravityCost*> gravity_;  ///< of a node; the problem owns it
  std::size_t annealed_ = 0;                               ///< loops that were in a solution already
  ceres::Problem problem_;                                 ///< last: it refers to what is above
};

PoseGraph::PoseGraph(const PoseGraphSettings& settings)
    : implementation_(std::make_unique<Implementation>(settings)) {}
PoseGraph::~PoseGraph() = default;
PoseGraph::PoseGraph(PoseGraph&&) noexcept = default;
PoseGraph& PoseGraph::operator=(PoseGraph&&) noexcept = default;

std::size_t PoseGraph::add_node(const Eigen::Isometry3d& T_map_imu) {
  return implementation_->add_node(T_map_imu);
}
void PoseGraph::add_odometry(const RelativePose& measured) { implementation_->add_odometry(measured); }
void PoseGraph::add_external_odometry(const ExternalStep& step) {
  implementation_->add_external_odometry(step);
}
double PoseGraph::external_scale() const { return implementation_->external_scale(); }
void PoseGraph::set_gravity(const GravityDirection& measured) { implementation_->set_gravity(measured); }
std::size_t PoseGraph::add_loop(const RelativePose& measured) { return implementation_->add_loop(measured); }
void PoseGraph::start_alignment(const EnuAlignment& alignment) {
  implementation_->start_alignment(alignment);
}
void PoseGraph::add_position(const PositionFix& fix) { implementation_->add_position(fix); }
bool PoseGraph::solve() { return implementation_->solve(); }
Eigen::Isometry3d PoseGraph::pose(std::size_t node) const { return implementation_->pose(node); }
EnuAlignment PoseGraph::alignment() const { return implementation_->alignment(); }
double PoseGraph::loop_weight(std::size_t loop) const { return implementation_->loop_weight(loop); }
double PoseGraph::squared_error(const RelativePose& measured) const {
  return implementation_->squared_error(measured);
}
std::size_t PoseGraph::node_count() const { return implementation_->node_count(); }
const std::vector<RelativePose>& PoseGraph::odometry() const { return implementation_->odometry(); }
const std::vector<RelativePose>& PoseGraph::loops() const { return implementation_->loops(); }

}  // namespace fdi_lio::mapping
