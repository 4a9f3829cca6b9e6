#include "fdi_lio/odometry/bright_scan.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <unordered_map>
#include <utility>

#include "fdi_lio/common/voxel_cells.hpp"

namespace fdi_lio::odometry {

namespace {

constexpr std::size_t kMostPoints = 10000;  ///< of a scan
constexpr float kColumnM = 1.0F;
constexpr float kStandingM = 0.35F;         ///< columns higher than this stand
constexpr double kRangeStep = 0.08;         ///< of the logarithm of ranges with one mean brightness
constexpr double kBeamStep = M_PI / 180.0;  ///< azimuth of points that are taken for one direction
/// So many points with a mean of zero are added to the mean of a direction, which is of few points.
constexpr double kFixedPrior = 3.0;

/// Finds out which points stand on others or under them, rather than lying in a flat column.
void find_standing(std::vector<BrightPoint>* points) {
  std::unordered_map<std::uint64_t, std::pair<float, float>> columns;
  const auto column_of = [](const Eigen::Vector3f& p) {
    return key_of(cell_of(Eigen::Vector3f(p.x(), p.y(), 0.0F) / kColumnM));
  };
  for (const BrightPoint& point : *points) {
    const float z = point.position.z();
    auto& [lowest, highest] = columns.try_emplace(column_of(point.position), z, z).first->second;
    lowest = std::min(lowest, z);
    highest = std::max(highest, z);
  }
  for (BrightPoint& point : *points) {
    const auto& [lowest, highest] = columns.at(column_of(point.position));
    point.stands = highest - lowest > kStandingM;
  }
}

/// Takes out of the details their mean over each group. The details of a group that lies flat do not count
/// for what stands in it, or the other way round. `prior`: so many more members with a detail of zero.
void subtract_means(const std::vector<BrightPoint*>& points, const std::vector<std::size_t>& groups,
                    double prior) {
  struct Sum {
    double sum = 0.0;
    double count = 0.0;
  };
  std::vector<Sum> sums(2 * (1 + *std::max_element(groups.begin(), groups.end())));
  const auto sum_of = [&](std::size_t k) -> Sum& {
    return sums[2 * groups[k] + (points[k]->stands ? 1 : 0)];
  };
  for (std::size_t k = 0; k < points.size(); ++k) {
    sum_of(k).sum += static_cast<double>(points[k]->detail);
    sum_of(k).count += 1.0;
  }
  for (std::size_t k = 0; k < points.size(); ++k)
    points[k]->detail -= static_cast<float>(sum_of(k).sum / (sum_of(k).count + prior));
}

}  // namespace

BrightScan bright_scan(const FeatureSet& features, const Eigen::Matrix3d& R_level_lidar,
                       const Eigen::Vector3d& v_deskew) {
  std::vector<BrightPoint> all;
  for (const std::vector<Point>* list : {&features.planes, &features.edges}) {
    for (const Point& point : *list) {
      const Eigen::Vector3d deskewed = R_level_lidar * point.position.cast<double>();
      BrightPoint seen;
      seen.position = (deskewed - static_cast<double>(point.time_s) * v_deskew).cast<float>();
      if (seen.position.head<2>().norm() > kBrightReachM) continue;
      seen.time_s = point.time_s;
      seen.detail = std::log1p(std::max(0.0F, point.intensity));
      seen.ring = point.ring;
      all.push_back(seen);
    }
  }
  find_standing(&all);
  std::vector<BrightPoint*> points;
  std::vector<std::size_t> ranges;
  std::vector<std::size_t> rings;
  for (BrightPoint& point : all) {
    const double range_m = std::max(1.0, static_cast<double>(point.position.norm()));
    points.push_back(&point);
    ranges.push_back(static_cast<std::size_t>(std::log(range_m) / kRangeStep));
    rings.push_back(point.ring);
  }
  if (!points.empty()) {
    subtract_means(points, ranges, 0.0);
    subtract_means(points, rings, 0.0);
  }

  BrightScan result;
  result.stamp = features.stamp;
  result.R_level_lidar = R_level_lidar;
  const std::size_t count = std::min(kMostPoints, all.size());
  for (std::size_t k = 0; k < count; ++k) result.points.push_back(all[k * all.size() / count]);
  return result;
}

void subtract_fixed(std::vector<BrightScan>* scans) {
  const auto columns = static_cast<std::size_t>(2.0 * M_PI / kBeamStep) + 2;
  std::vector<BrightPoint*> points;
  std::vector<std::size_t> beams;
  for (BrightScan& scan : *scans) {
    for (BrightPoint& point : scan.points) {
      const Eigen::Vector3d seen = scan.R_level_lidar.transpose() * point.position.cast<double>();
      const auto column = static_cast<std::size_t>((std::atan2(seen.y(), seen.x()) + M_PI) / kBeamStep);
      points.push_back(&point);
      beams.push_back(point.ring * columns + column);
    }
  }
  if (!points.empty()) subtract_means(points, beams, kFixedPrior);
}

}  // namespace fdi_lio::odometry
