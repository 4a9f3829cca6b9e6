#include "fdi_lio/degeneracy/metrics.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace fdi_lio::degeneracy {

namespace {

constexpr std::size_t kCurvatureBins = 1024;
/// The window of a curvature grows to this many times `curvature_neighbours` where points are dense.
constexpr std::size_t kLargestWindow = 4;
/// A scan's largest gradient counts as at least so many times that of noise: a blank surface then has a mean
/// of 1/6, below the neutral `gradient_centre`.
constexpr double kClearGradient = 6.0;

using CurvatureHistogram = std::array<std::uint32_t, kCurvatureBins>;

/// Value below which `share` of the entries lie, to one bin (lower border, so that all-zero gives 0).
double quantile(const CurvatureHistogram& histogram, std::uint64_t total, double share) {
  const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(total - 1)) + 1;
  std::uint64_t seen = 0;
  for (std::size_t bin = 0; bin < kCurvatureBins; ++bin) {
    seen += histogram[bin];
    if (seen >= wanted) return static_cast<double>(bin) / kCurvatureBins;
  }
  return 1.0;
}

/// Adds the curvatures of the sampled points of the ring [begin, end).
void add_ring(const DeskewedScan& scan, std::size_t begin, std::size_t end, std::size_t stride,
              float noise_floor_m, const DegeneracyConfig& config, CurvatureHistogram* histogram) {
  const auto least = static_cast<std::size_t>(config.curvature_neighbours);
  const auto most = static_cast<float>(kLargestWindow * least);
  const float angle_step =
      2.0F * static_cast<float>(M_PI) / static_cast<float>(std::max<std::size_t>(end - begin, 360));
  const float wanted = static_cast<float>(config.curvature_half_width_m) / angle_step;
  for (std::size_t i = (begin + stride - 1) / stride * stride; i < end; i += stride) {
    const Eigen::Vector3f& p = scan.points[i].position;
    const float points = std::min(most, std::ceil(wanted / p.norm()));
    const std::size_t n = points > static_cast<float>(least) ? static_cast<std::size_t>(points) : least;
    if (i < begin + n || i + n >= end) continue;
    const float curvature =
        ring_curvature(scan.points[i - n].position, p, scan.points[i + n].position, noise_floor_m);
    if (!std::isfinite(curvature)) continue;
    const auto bin = static_cast<std::size_t>(curvature * static_cast<float>(kCurvatureBins));
    ++(*histogram)[std::min(bin, kCurvatureBins - 1)];
  }
}

}  // namespace

double eigenvalue_entropy(const Eigen::Vector3d& eigenvalues) {
  const double sum = eigenvalues.sum();
  if (!(sum > 0.0)) return 0.0;
  double entropy = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double share = eigenvalues[i] / sum;
    if (share > 0.0) entropy -= share * std::log(share);
  }
  return std::clamp(entropy / std::log(3.0), 0.0, 1.0);
}

double local_shape_entropy(const VoxelStatistics& voxels) {
  if (voxels.shapes().empty()) return 0.0;
  double sum = 0.0;
  for (const VoxelShape& shape : voxels.shapes()) sum += eigenvalue_entropy(shape.eigenvalues);
  return sum / static_cast<double>(voxels.shapes().size());
}

double orientation_entropy(const VoxelStatistics& voxels) {
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const VoxelShape& shape : voxels.shapes()) {
    const Eigen::Vector3d& l = shape.eigenvalues;
    if (l[2] > 0.0) scatter += (l[1] - l[0]) / l[2] * shape.normal * shape.normal.transpose();
  }
  if (!(scatter.trace() > 1e-12)) return 0.0;
  scatter /= scatter.trace();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(scatter, Eigen::EigenvaluesOnly);
  return eigenvalue_entropy(solver.eigenvalues().cwiseMax(0.0));
}

double geometric_complexity(const VoxelStatistics& voxels, const DegeneracyConfig& config) {
  const double a = config.orientation_share;
  return (1.0 - a) * local_shape_entropy(voxels) + a * orientation_entropy(voxels);
}

double plane_deviation_m(const DeskewedScan& scan, const VoxelStatistics& voxels) {
  struct Plane {
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    float offset_m = 0.0F;
    bool valid = false;
  };
  std::vector<Plane> planes(voxels.voxels().size());
  for (const VoxelShape& shape : voxels.shapes()) {
    Plane& plane = planes[shape.voxel];
    plane.normal = shape.normal.cast<float>();
    plane.offset_m = static_cast<float>(shape.normal.dot(voxels.voxels()[shape.voxel].mean_offset()));
    plane.valid = true;
  }
  double sum_m = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < voxels.voxel_of_sample().size(); ++i) {
    const std::uint32_t voxel = voxels.voxel_of_sample()[i];
    if (voxel == VoxelStatistics::kNoVoxel || !planes[voxel].valid) continue;
    const Eigen::Vector3f d = scan.points[i * voxels.stride()].position - voxels.voxels()[voxel].origin;
    sum_m += std::abs(planes[voxel].normal.dot(d) - planes[voxel].offset_m);
    ++count;
  }
  return count > 0 ? sum_m / static_cast<double>(count) : 0.0;
}

double point_entropy(const VoxelStatistics& voxels, const DegeneracyConfig& config) {
  if (voxels.sample_count() == 0) return 0.0;
  const auto total = static_cast<double>(voxels.sample_count());
  double entropy = 0.0;
  for (const VoxelMoments& voxel : voxels.voxels()) {
    const double share = voxel.count / total;
    entropy -= share * std::log(share);
  }
  const std::size_t largest =
      std::max(voxels.voxels().size(), static_cast<std::size_t>(config.entropy_reference_voxels));
  return std::clamp(entropy / std::log(static_cast<double>(largest)), 0.0, 1.0);
}

float ring_curvature(const Eigen::Vector3f& left, const Eigen::Vector3f& middle, const Eigen::Vector3f& right,
                     float noise_floor_m) {
  const Eigen::Vector3f a = left - middle;
  const Eigen::Vector3f b = right - middle;
  const float spread = a.norm() + b.norm();
  if (spread == 0.0F) return 0.0F;
  const float deviation = (a + b).norm() - noise_floor_m;
  if (std::isnan(deviation)) return deviation;
  return std::clamp(deviation / spread, 0.0F, 1.0F);
}

double curvature_complexity(const DeskewedScan& scan, std::size_t stride, double range_noise_m,
                            const DegeneracyConfig& config) {
  CurvatureHistogram histogram{};
  const auto noise_floor_m = static_cast<float>(2.0 * std::sqrt(6.0) * range_noise_m);
  for (std::size_t ring = 0; ring < scan.ring_count(); ++ring) {
    const std::size_t end = std::min<std::size_t>(scan.ring_begin[ring + 1], scan.points.size());
    const std::size_t begin = std::min<std::size_t>(scan.ring_begin[ring], end);
    add_ring(scan, begin, end, stride, noise_floor_m, config, &histogram);
  }
  std::uint64_t total = 0;
  for (const std::uint32_t count : histogram) total += count;
  if (total == 0) return 0.0;
  const double spread = quantile(histogram, total, 0.9) - quantile(histogram, total, 0.1);
  return spread / (quantile(histogram, total, 0.5) + config.curvature_floor);
}

GradientStatistics gradient_statistics(const DeskewedScan& scan, std::size_t stride,
                                       const DegeneracyConfig& config) {
  GradientStatistics result;
  if (scan.points.empty() || scan.intensity_gradient.size() != scan.points.size()) return result;
  std::vector<float> gradients;
  gradients.reserve(scan.points.size() / stride + 1);
  double sum = 0.0;
  for (std::size_t i = 0; i < scan.points.size(); i += stride) {
    const float gradient = scan.intensity_gradient[i];
    if (!std::isfinite(gradient)) continue;
    gradients.push_back(std::max(0.0F, gradient));
    sum += gradients.back();
  }
  if (gradients.empty()) return result;
  result.valid = true;
  const auto count = static_cast<double>(gradients.size());
  const double mean = sum / count;
  double squares = 0.0;
  double clipped = 0.0;
  const auto index = static_cast<std::ptrdiff_t>(config.gradient_percentile * (count - 1.0));
  for (const float gradient : gradients) squares += (gradient - mean) * (gradient - mean);
  std::nth_element(gradients.begin(), gradients.begin() + index, gradients.end());
  const double largest =
      std::max<double>(gradients[static_cast<std::size_t>(index)], kClearGradient * config.gradient_floor);
  for (const float gradient : gradients) clipped += std::min<double>(gradient, largest);
  result.mean = clipped / count / largest;
  result.variation = std::sqrt(squares / count) / std::max(mean, config.gradient_floor);
  return result;
}

}  // namespace fdi_lio::degeneracy
