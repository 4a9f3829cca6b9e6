#include "fdi_lio/mapping/place_descriptor.hpp"

#include <algorithm>
#include <cmath>

#include "fdi_lio/scan/range_image.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr int kRings = PlaceDescriptor::kRings;
constexpr int kSectors = PlaceDescriptor::kSectors;
/// Share of the points that may lie below what counts as the ground.
constexpr double kGroundShare = 0.05;
constexpr float kMaxHeight = 12.0F;
constexpr float kOccupied = 0.2F;  ///< of a cell that has ground only
constexpr double kIntensityShare = 0.25;

struct LevelPoint {
  int ring;
  int sector;
  float z;
  float intensity;
};

std::vector<LevelPoint> to_cells(const std::vector<Point>& points, const Eigen::Matrix3d& R_level_imu,
                                 double range_m) {
  const Eigen::Matrix3f R = R_level_imu.cast<float>();
  const auto rings_per_m = static_cast<float>(kRings / range_m);
  std::vector<LevelPoint> cells;
  cells.reserve(points.size());
  for (const Point& point : points) {
    const Eigen::Vector3f p = R * point.position;
    const int ring = static_cast<int>(p.head<2>().norm() * rings_per_m);
    if (ring >= kRings) continue;
    const float turn = 0.5F + scan::fast_atan2(p.y(), p.x()) * static_cast<float>(0.5 / M_PI);
    const int sector = std::clamp(static_cast<int>(turn * kSectors), 0, kSectors - 1);
    cells.push_back({ring, sector, p.z(), point.intensity});
  }
  return cells;
}

float ground_level(const std::vector<LevelPoint>& cells) {
  std::vector<float> heights;
  heights.reserve(cells.size());
  for (const LevelPoint& cell : cells) heights.push_back(cell.z);
  const auto low = heights.begin() + static_cast<std::ptrdiff_t>(kGroundShare * heights.size());
  std::nth_element(heights.begin(), low, heights.end());
  return *low;
}

/// Mean over the sectors that both places fill of the cosine between their columns.
double column_similarity(const PlaceDescriptor::Grid& a, const PlaceDescriptor::Grid& b, int shift) {
  double sum = 0.0;
  int filled = 0;
  for (int sector = 0; sector < kSectors; ++sector) {
    const auto column_a = a.col((sector + shift) % kSectors).matrix();
    const auto column_b = b.col(sector).matrix();
    const float norms = column_a.norm() * column_b.norm();
    if (norms <= 0.0F) continue;
    sum += static_cast<double>(column_a.dot(column_b) / norms);
    ++filled;
  }
  return filled < kSectors / 4 ? 0.0 : sum / filled;
}

/// Correlation of the intensities over the cells that both places fill.
double intensity_similarity(const PlaceDescriptor& a, const PlaceDescriptor& b, int shift) {
  const auto empty = Eigen::half(0.0F);
  double aa = 0.0;
  double bb = 0.0;
  double ab = 0.0;
  for (int sector = 0; sector < kSectors; ++sector) {
    const int other = (sector + shift) % kSectors;
    for (int ring = 0; ring < kRings; ++ring) {
      if (a.height(ring, other) <= empty || b.height(ring, sector) <= empty) continue;
      const auto va = static_cast<double>(a.intensity(ring, other));
      const auto vb = static_cast<double>(b.intensity(ring, sector));
      aa += va * va;
      bb += vb * vb;
      ab += va * vb;
    }
  }
  return aa * bb > 0.0 ? ab / std::sqrt(aa * bb) : 0.0;
}

}  // namespace

Eigen::Matrix3d levelled(const Eigen::Matrix3d& R_odom_imu) {
  const double yaw = std::atan2(R_odom_imu(1, 0), R_odom_imu(0, 0));
  return Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * R_odom_imu;
}

Eigen::Matrix3d rotation_between_places(const Eigen::Matrix3d& R_odom_imu_a, double yaw_rad,
                                        const Eigen::Matrix3d& R_odom_imu_b) {
  const Eigen::Matrix3d R_turn = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return levelled(R_odom_imu_a).transpose() * R_turn * levelled(R_odom_imu_b);
}

PlaceDescriptor describe_place(const std::vector<Point>& points, const Eigen::Matrix3d& R_level_imu,
                               double range_m) {
  PlaceDescriptor place;
  const std::vector<LevelPoint> cells = to_cells(points, R_level_imu, range_m);
  if (cells.empty()) return place;
  const float ground = ground_level(cells);
  PlaceDescriptor::Grid heights = PlaceDescriptor::Grid::Zero();
  PlaceDescriptor::Grid brightness = PlaceDescriptor::Grid::Zero();
  PlaceDescriptor::Grid count = PlaceDescriptor::Grid::Zero();
  for (const LevelPoint& cell : cells) {
    float& height = heights(cell.ring, cell.sector);
    height = std::max(height, kOccupied + std::clamp(cell.z - ground, 0.0F, kMaxHeight));
    brightness(cell.ring, cell.sector) += cell.intensity;
    ++count(cell.ring, cell.sector);
  }
  for (int ring = 0; ring < kRings; ++ring) {
    const auto counts = count.row(ring);
    const float occupied = static_cast<float>((counts > 0.0F).count());
    place.ring_key[ring] = heights.row(ring).mean() / kMaxHeight;
    place.ring_key[kRings + ring] = occupied / kSectors;
    auto intensities = brightness.row(ring);
    intensities = (counts > 0.0F).select(intensities / counts.max(1.0F), 0.0F);
    const float mean = occupied > 0.0F ? intensities.sum() / occupied : 0.0F;
    if (mean > 0.0F)
      intensities = (counts > 0.0F).select((intensities / mean - 1.0F).min(1.0F).max(-1.0F), 0.0F);
  }
  place.height = heights.cast<Eigen::half>();
  place.intensity = brightness.cast<Eigen::half>();
  return place;
}

PlaceMatch compare_places(const PlaceDescriptor& a, const PlaceDescriptor& b) {
  const PlaceDescriptor::Grid height_a = a.height.cast<float>();
  const PlaceDescriptor::Grid height_b = b.height.cast<float>();
  int best_shift = 0;
  double best = -1.0;
  for (int shift = 0; shift < kSectors; ++shift) {
    const double similarity = column_similarity(height_a, height_b, shift);
    if (similarity <= best) continue;
    best = similarity;
    best_shift = shift;
  }
  PlaceMatch match;
  match.distance = 1.0 - (1.0 - kIntensityShare) * best -
                   kIntensityShare * std::max(0.0, intensity_similarity(a, b, best_shift));
  const int shift = best_shift < kSectors / 2 ? best_shift : best_shift - kSectors;
  match.yaw_rad = 2.0 * M_PI * shift / kSectors;
  return match;
}

double ring_key_distance(const PlaceDescriptor& a, const PlaceDescriptor& b) {
  return (a.ring_key - b.ring_key).matrix().norm();
}

std::vector<AlikePlace> most_alike(const Places& places, const std::vector<std::size_t>& candidates,
                                   const PlaceDescriptor& query, const AlikeSearch& search) {
  std::vector<AlikePlace> scored;
  for (const std::size_t index : candidates)
    scored.push_back({index, {ring_key_distance(places[index], query), 0.0}});
  const auto nearer = [](const AlikePlace& a, const AlikePlace& b) {
    return a.match.distance < b.match.distance || (a.match.distance == b.match.distance && a.index < b.index);
  };
  std::sort(scored.begin(), scored.end(), nearer);
  if (scored.size() > search.key_candidates) scored.resize(search.key_candidates);
  for (AlikePlace& each : scored) each.match = compare_places(places[each.index], query);
  std::sort(scored.begin(), scored.end(), nearer);
  std::vector<AlikePlace> alike;
  for (const AlikePlace& each : scored) {
    if (each.match.distance > search.max_distance || alike.size() >= search.limit) break;
    const bool is_known = std::any_of(alike.begin(), alike.end(), [&](const AlikePlace& other) {
      return search.is_same(other.index, each.index);
    });
    if (!is_known) alike.push_back(each);
  }
  return alike;
}

}  // namespace fdi_lio::mapping
