#include <algorithm>
#include <cmath>
#include <ctime>
#include <iostream>
#include <random>
#include <vector>

#include <sys/resource.h>

#include "fdi_lio/common/so3.hpp"
#include "fdi_lio/mapping/pose_graph.hpp"

namespace {

using fdi_lio::mapping::PoseGraph;
using fdi_lio::mapping::RelativePose;

constexpr std::size_t kNodes = 10000;
constexpr std::size_t kLoops = 500;
constexpr std::size_t kLap = 1000;  ///< nodes of one round: the later rounds meet the earlier ones
constexpr double kStepM = 1.0;
constexpr double kSigmaRotation = 5e-4;
constexpr double kSigmaTranslation = 0.01;
constexpr double kSigmaLoop = 0.05;

/// Processor time, which does not depend on what else runs on the machine.
double cpu_seconds_of_solving(PoseGraph* graph) {
  const std::clock_t begin = std::clock();
  if (!graph->solve()) std::cerr << "no usable solution\n";
  return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
}

/// Rounds of a circle, with noisy odometry.
class Drive {
 public:
  Drive() : graph_(fdi_lio::mapping::PoseGraphSettings()), random_(1) {
    Eigen::Isometry3d step = Eigen::Isometry3d::Identity();
    step.translation().x() = kStepM;
    step.linear() = fdi_lio::so3::exp(Eigen::Vector3d(0.0, 0.0, 2.0 * M_PI / kLap));
    truth_.push_back(Eigen::Isometry3d::Identity());
    graph_.add_node(truth_[0]);
    for (std::size_t k = 1; k < kNodes; ++k) {
      truth_.push_back(truth_.back() * step);
      const RelativePose edge = measure(k - 1, k, kSigmaRotation, kSigmaTranslation);
      graph_.add_node(graph_.pose(k - 1) * edge.T_from_to);
      graph_.add_odometry(edge);
    }
  }

  PoseGraph* graph() { return &graph_; }

  void add_loop() {
    std::uniform_int_distribution<std::size_t> later(kLap, kNodes - 1);
    const std::size_t to = later(random_);
    std::uniform_int_distribution<std::size_t> rounds(1, to / kLap);
    graph_.add_loop(measure(to - kLap * rounds(random_), to, 0.1 * kSigmaLoop, kSigmaLoop));
  }

  double rmse() const {
    double sum = 0.0;
    for (std::size_t k = 0; k < kNodes; ++k)
      sum += (graph_.pose(k).translation() - truth_[k].translation()).squaredNorm();
    return std::sqrt(sum / kNodes);
  }

 private:
  RelativePose measure(std::size_t from, std::size_t to, double sigma_rotation, double sigma_translation) {
    std::normal_distribution<double> normal;
    const auto draw = [&] { return Eigen::Vector3d(normal(random_), normal(random_), normal(random_)); };
    RelativePose edge;
    edge.from = from;
    edge.to = to;
    edge.T_from_to = truth_[from].inverse() * truth_[to];
    edge.T_from_to.rotate(fdi_lio::so3::exp_q(sigma_rotation * draw()));
    edge.T_from_to.translation() += sigma_translation * draw();
    edge.information.diagonal().head<3>().setConstant(std::pow(sigma_rotation, -2));
    edge.information.diagonal().tail<3>().setConstant(std::pow(sigma_translation, -2));
    return edge;
  }

  PoseGraph graph_;
  std::mt19937 random_;
  std::vector<Eigen::Isometry3d> truth_;
};

}  // namespace

/// Prints how long a large graph takes: all loops at once, then one more.
int main() {
  Drive drive;
  std::cout << kNodes << " nodes, odometry only: RMSE " << drive.rmse() << " m\n";
  for (std::size_t k = 0; k < kLoops; ++k) drive.add_loop();
  std::cout << "full solve with " << kLoops << " loops: " << cpu_seconds_of_solving(drive.graph())
            << " s of one core, RMSE " << drive.rmse() << " m\n";
  std::vector<double> durations;
  for (int k = 0; k < 21; ++k) {
    drive.add_loop();
    durations.push_back(cpu_seconds_of_solving(drive.graph()));
  }
  std::sort(durations.begin(), durations.end());
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::cout << "one more loop: median " << durations[10] << " s, slowest of 21 " << durations.back()
            << " s of one core, RMSE " << drive.rmse() << " m, peak memory " << usage.ru_maxrss / 1024
            << " MB\n";
  return 0;
}
