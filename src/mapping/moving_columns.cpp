#include "fdi_lio/mapping/moving_columns.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "fdi_lio/common/voxel_cells.hpp"
#include "fdi_lio/mapping/map_builder.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr float kColumnM = 0.25F;
constexpr float kBelowM = 0.5F;
constexpr float kAboveM = 0.2F;

Eigen::Vector3i column_of(const Eigen::Vector3f& level) {
  return cell_of(Eigen::Vector3f(level.x() / kColumnM, level.y() / kColumnM, 0.0F));
}

bool is_moving(RemovalReason reason) {
  return reason != RemovalReason::kNone && reason != RemovalReason::kIsolated;
}

}  // namespace

MovingColumns::MovingColumns(const DeskewedScan& scan, const Eigen::Matrix3d& R_level_lidar)
    : R_level_lidar_(R_level_lidar.cast<float>()) {
  KeyIndex seen;
  std::vector<Eigen::Vector3i> columns;
  std::vector<Span> spans;
  for (std::size_t i = 0; i < scan.removed.size(); ++i) {
    if (!is_moving(scan.removal_reasons[i])) continue;
    const Eigen::Vector3f level = R_level_lidar_ * scan.removed[i].position;
    const Eigen::Vector3i column = column_of(level);
    const std::uint32_t number = seen.find_or_add(key_of(column));
    if (number == spans.size()) {
      columns.push_back(column);
      spans.push_back({level.z(), level.z()});
    }
    spans[number].lowest_m = std::min(spans[number].lowest_m, level.z());
    spans[number].highest_m = std::max(spans[number].highest_m, level.z());
  }
  for (std::size_t k = 0; k < columns.size(); ++k) {
    for (int neighbour = 0; neighbour < 9; ++neighbour) {
      const Eigen::Vector3i column = columns[k] + Eigen::Vector3i(neighbour % 3 - 1, neighbour / 3 - 1, 0);
      const std::uint32_t number = index_.find_or_add(key_of(column));
      if (number == spans_.size()) spans_.push_back(spans[k]);
      spans_[number].lowest_m = std::min(spans_[number].lowest_m, spans[k].lowest_m);
      spans_[number].highest_m = std::max(spans_[number].highest_m, spans[k].highest_m);
    }
  }
}

bool MovingColumns::hold(const Eigen::Vector3f& position) const {
  const Eigen::Vector3f level = R_level_lidar_ * position;
  const std::uint32_t number = index_.find(key_of(column_of(level)));
  if (number == KeyIndex::kNone) return false;
  return level.z() >= spans_[number].lowest_m - kBelowM && level.z() <= spans_[number].highest_m + kAboveM;
}

std::vector<Point> MovingColumns::without(const std::vector<Point>& points) const {
  if (spans_.empty()) return points;
  std::vector<Point> left;
  left.reserve(points.size());
  std::copy_if(points.begin(), points.end(), std::back_inserter(left),
               [this](const Point& point) { return !hold(point.position); });
  return left;
}

}  // namespace fdi_lio::mapping
